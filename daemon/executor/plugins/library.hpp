/// @file
/// A shared library of components. It is opened once and never closed, because log records, slots
/// and threads may still refer to its code. It is loaded from a private copy in memory, so that
/// rebuilding the file cannot crash the loop, and the rebuilt file loads beside the old code. Not
/// real-time.
#pragma once

#include <sys/types.h>

#include <memory>
#include <set>
#include <string>
#include <vector>

#include "rtcf/component.hpp"

namespace rtcf::executor {

class Library {
   public:
    /// @param path name of the file, for errors
    /// @param file the file, open for reading
    /// @throws Error naming the missing symbol, or both ABI versions
    Library(const std::string& path, int file);

    const std::string& path() const noexcept { return path_; }
    /// Handle of dlopen().
    void* handle() const noexcept { return handle_; }
    /// The library's component types, sorted by name.
    const std::vector<const ComponentRecord*>& types() const noexcept { return types_; }
    /// @return null if the library has no such type
    const ComponentRecord* find(const std::string& type) const noexcept;

   private:
    std::string path_;
    void* handle_ = nullptr;
    std::vector<const ComponentRecord*> types_;
};

/// The libraries of one process: a file that has not changed is opened once.
class LibraryStore {
   public:
    LibraryStore();

    /// Trusts libraries of this user, in addition to those of root and the executor's own user.
    void trust(uid_t owner) { owners_.insert(owner); }
    /// Opens a library, unless the same file is open already.
    /// @throws Error like openTrusted() and Library
    std::shared_ptr<const Library> open(const std::string& path);

   private:
    void requireTrustedFinds(const std::string& path);

    struct Entry {
        std::string identity;  // path, device, inode, time and size
        std::shared_ptr<const Library> library;
    };
    std::vector<Entry> entries_;
    std::set<uid_t> owners_;
    std::set<std::string> linked_;  // files of loaded libraries that are trusted
};

}  // namespace rtcf::executor

/// @file
/// A shared library of components, opened once and never closed: code that a
/// log record, a slot or a thread may still refer to must not go away. Loaded
/// from a private copy in memory, so that rebuilding the file cannot crash the
/// loop and the rebuilt file loads beside the old code. Not real-time.
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
    /// @param path for messages
    /// @param file what is there, open for reading
    /// @throws Refusal naming the missing symbol, or both ABI versions
    Library(const std::string& path, int file);

    const std::string& path() const noexcept { return path_; }
    /// Of dlopen().
    void* handle() const noexcept { return handle_; }
    /// The library's types, by name.
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

    /// Also trusts libraries that belong to this user; root's and our own user's are.
    void trust(uid_t owner) { owners_.insert(owner); }
    /// @throws Refusal as openTrusted() and Library do
    std::shared_ptr<const Library> open(const std::string& path);

   private:
    void requireTrustedFinds(const std::string& path);

    struct Entry {
        std::string identity;  // path, inode, time and size
        std::shared_ptr<const Library> library;
    };
    std::vector<Entry> entries_;
    std::set<uid_t> owners_;
    std::set<std::string> linked_;  // files of libraries that are loaded, ours and others
};

}  // namespace rtcf::executor

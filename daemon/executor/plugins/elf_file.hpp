/// @file
/// The entries of an ELF file for the dynamic loader. Read from the file, without loading it. Not
/// real-time.
#pragma once

#include <link.h>

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

namespace rtcf::executor {

/// All members are empty if the file is not a valid ELF file; the loader rejects such a file later.
class ElfFile {
   public:
    /// @param file open for reading; not kept
    explicit ElfFile(int file) : file_(file) { read(); }

    std::vector<std::string> needed;
    std::string runpath;
    std::string rpath;
    /// The library has thread_local variables whose memory is allocated at a thread's first use.
    bool lazy_thread_locals = false;

   private:
    template <typename T>
    std::optional<T> at(std::uint64_t offset) const;
    void read();
    void readEntries(std::uint64_t begin, std::uint64_t size);
    std::uint64_t fileOffset(std::uint64_t address) const;
    std::string text(std::uint64_t index) const;

    int file_;
    std::vector<ElfW(Phdr)> segments_;
    std::uint64_t strings_ = 0;  // offset of the string table in the file
    bool static_thread_locals_ = false;
};

}  // namespace rtcf::executor

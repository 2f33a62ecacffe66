/// @file
/// What an ELF file has for the dynamic loader. Read from the file, nothing is loaded. Not
/// real-time.
#pragma once

#include <link.h>

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

namespace rtcf::executor {

/// What is no valid ELF file has none of it: the loader refuses it.
class ElfFile {
   public:
    /// @param file open for reading; not kept
    explicit ElfFile(int file) : file_(file) { read(); }

    std::vector<std::string> needed;
    std::string runpath;
    std::string rpath;
    /// It has thread_local variables whose memory the loader gets at a thread's first use of one.
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
    std::uint64_t strings_ = 0;  // where in the file
    bool static_thread_locals_ = false;
};

}  // namespace rtcf::executor

#include "plugins/elf_file.hpp"

#include <elf.h>
#include <unistd.h>

#include <cstring>

namespace rtcf::executor {

template <typename T>
std::optional<T> ElfFile::at(std::uint64_t offset) const {
    T value;
    if (::pread(file_, &value, sizeof value, static_cast<off_t>(offset)) != sizeof value)
        return std::nullopt;
    return value;
}

void ElfFile::read() {
    const auto header = at<ElfW(Ehdr)>(0);
    if (!header || std::memcmp(header->e_ident, ELFMAG, SELFMAG) != 0) return;
    for (std::size_t i = 0; i < header->e_phnum; ++i) {
        const auto segment = at<ElfW(Phdr)>(header->e_phoff + i * header->e_phentsize);
        if (segment) segments_.push_back(*segment);
    }
    for (const ElfW(Phdr) & segment : segments_) {
        if (segment.p_type == PT_DYNAMIC) readEntries(segment.p_offset, segment.p_filesz);
    }
    for (const ElfW(Phdr) & segment : segments_) {
        if (segment.p_type == PT_TLS && segment.p_memsz != 0)
            lazy_thread_locals = !static_thread_locals_;
    }
}

void ElfFile::readEntries(std::uint64_t begin, std::uint64_t size) {
    std::vector<ElfW(Dyn)> entries;
    for (std::uint64_t offset = 0; offset + sizeof(ElfW(Dyn)) <= size;
         offset += sizeof(ElfW(Dyn))) {
        const auto entry = at<ElfW(Dyn)>(begin + offset);
        if (!entry || entry->d_tag == DT_NULL) break;
        if (entry->d_tag == DT_STRTAB) strings_ = fileOffset(entry->d_un.d_ptr);
        entries.push_back(*entry);
    }
    for (const ElfW(Dyn) & entry : entries) {
        switch (entry.d_tag) {
            case DT_NEEDED:
            case DT_FILTER:
            case DT_AUXILIARY:
                needed.push_back(text(entry.d_un.d_val));
                break;
            case DT_RUNPATH:
                runpath = text(entry.d_un.d_val);
                break;
            case DT_FLAGS:
                static_thread_locals_ = (entry.d_un.d_val & DF_STATIC_TLS) != 0;
                break;
            case DT_RPATH:
                rpath = text(entry.d_un.d_val);
                break;
            default:
                break;
        }
    }
}

std::uint64_t ElfFile::fileOffset(std::uint64_t address) const {
    for (const ElfW(Phdr) & segment : segments_) {
        if (segment.p_type == PT_LOAD && address >= segment.p_vaddr &&
            address - segment.p_vaddr < segment.p_filesz)
            return address - segment.p_vaddr + segment.p_offset;
    }
    return 0;
}

std::string ElfFile::text(std::uint64_t index) const {
    std::string result;
    for (std::uint64_t offset = strings_ + index;; ++offset) {
        const auto character = at<char>(offset);
        if (!character || *character == '\0') return result;
        result += *character;
    }
}

}  // namespace rtcf::executor

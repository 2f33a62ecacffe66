#include "plugins/linked_files.hpp"

#include <elf.h>
#include <fmt/format.h>
#include <link.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cstring>
#include <filesystem>
#include <optional>
#include <vector>

#include "plugins/trusted_file.hpp"
#include "refusal.hpp"

namespace rtcf::executor {

namespace {

/// The words for the dynamic loader in an ELF file. What is no valid one has none: the loader
/// refuses it.
class DynamicSection {
   public:
    explicit DynamicSection(int file) : file_(file) { read(); }

    std::vector<std::string> needed;
    std::string runpath;
    std::string rpath;

   private:
    template <typename T>
    std::optional<T> at(std::uint64_t offset) const {
        T value;
        if (::pread(file_, &value, sizeof value, static_cast<off_t>(offset)) != sizeof value)
            return std::nullopt;
        return value;
    }

    void read() {
        const auto header = at<ElfW(Ehdr)>(0);
        if (!header || std::memcmp(header->e_ident, ELFMAG, SELFMAG) != 0) return;
        for (std::size_t i = 0; i < header->e_phnum; ++i) {
            const auto segment = at<ElfW(Phdr)>(header->e_phoff + i * header->e_phentsize);
            if (segment) segments_.push_back(*segment);
        }
        for (const ElfW(Phdr) & segment : segments_) {
            if (segment.p_type == PT_DYNAMIC) readEntries(segment.p_offset, segment.p_filesz);
        }
    }

    void readEntries(std::uint64_t begin, std::uint64_t size) {
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
                case DT_RPATH:
                    rpath = text(entry.d_un.d_val);
                    break;
                default:
                    break;
            }
        }
    }

    std::uint64_t fileOffset(std::uint64_t address) const {
        for (const ElfW(Phdr) & segment : segments_) {
            if (segment.p_type == PT_LOAD && address >= segment.p_vaddr &&
                address - segment.p_vaddr < segment.p_filesz)
                return address - segment.p_vaddr + segment.p_offset;
        }
        return 0;
    }

    std::string text(std::uint64_t index) const {
        std::string result;
        for (std::uint64_t offset = strings_ + index;; ++offset) {
            const auto character = at<char>(offset);
            if (!character || *character == '\0') return result;
            result += *character;
        }
    }

    int file_;
    std::vector<ElfW(Phdr)> segments_;
    std::uint64_t strings_ = 0;  // where in the file
};

class LinkCheck {
   public:
    LinkCheck(const std::string& library, const std::set<uid_t>& owners)
        : library_(library), owners_(owners) {}

    /// @param origin what $ORIGIN is to the loader
    /// @param inherited the RPATH of those that link against this one
    void check(int file, const std::string& origin, const std::vector<std::string>& inherited) {
        const DynamicSection section(file);
        const bool own = !section.runpath.empty();
        std::vector<std::string> folders = split(own ? section.runpath : section.rpath, origin);
        if (!own) folders.insert(folders.end(), inherited.begin(), inherited.end());
        for (const std::string& name : section.needed) {
            if (name.find('/') != std::string::npos) {
                if (name.front() != '/') refuse("links against " + name + ", a relative path");
                checkFile(name, own ? std::vector<std::string>() : folders);
                continue;
            }
            for (const std::string& folder : folders) {
                const std::string found = folder + "/" + name;
                struct stat status{};
                if (::stat(found.c_str(), &status) != 0) continue;
                checkFile(found, own ? std::vector<std::string>() : folders);
                break;
            }
        }
    }

   private:
    void checkFile(const std::string& path, const std::vector<std::string>& inherited) {
        if (!seen_.insert(path).second) return;
        const int file = openTrusted(
            path, owners_, fmt::format("library {}, which links against {}", library_, path));
        try {
            check(file, std::filesystem::path(path).parent_path(), inherited);
        } catch (const Refusal&) {
            ::close(file);
            throw;
        }
        ::close(file);
    }

    std::vector<std::string> split(const std::string& run_path, const std::string& origin) const {
        std::vector<std::string> folders;
        if (run_path.empty()) return folders;
        for (std::size_t begin = 0; begin <= run_path.size();) {
            const std::size_t end = std::min(run_path.find(':', begin), run_path.size());
            folders.push_back(expanded(run_path.substr(begin, end - begin), origin));
            requireTrustedFolder(
                folders.back(), owners_,
                fmt::format("library {}, with {} in its run path", library_, folders.back()));
            begin = end + 1;
        }
        return folders;
    }

    std::string expanded(std::string folder, const std::string& origin) const {
        for (const std::string word : {"${ORIGIN}", "$ORIGIN"}) {
            for (std::size_t at = folder.find(word); at != std::string::npos;
                 at = folder.find(word, at + origin.size()))
                folder.replace(at, word.size(), origin);
        }
        // An empty one is the current folder.
        if (folder.empty() || folder.front() != '/' || folder.find('$') != std::string::npos)
            refuse(fmt::format("its run path has \"{}\", which is no absolute folder", folder));
        return folder;
    }

    [[noreturn]] void refuse(const std::string& why) const {
        throw Refusal(RefusalKind::FailedPrecondition,
                      fmt::format("library {}: {}: build it without", library_, why));
    }

    const std::string& library_;
    const std::set<uid_t>& owners_;
    std::set<std::string> seen_;
};

}  // namespace

void requireTrustedLinks(const std::string& path, int file, const std::set<uid_t>& owners) {
    // What is loaded is a copy: see Library.
    LinkCheck(path, owners).check(file, fmt::format("/proc/{}/fd", ::getpid()), {});
}

std::set<std::string> loadedFiles() {
    std::set<std::string> files;
    ::dl_iterate_phdr(
        [](dl_phdr_info* info, std::size_t, void* data) {
            // Neither the program itself, nor the kernel's, nor our copies.
            const std::string name = info->dlpi_name;
            if (name.rfind('/', 0) == 0 && name.rfind("/proc/", 0) != 0)
                static_cast<std::set<std::string>*>(data)->insert(name);
            return 0;
        },
        &files);
    return files;
}

}  // namespace rtcf::executor

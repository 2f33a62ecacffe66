#include "plugins/linked_files.hpp"

#include <fmt/format.h>
#include <link.h>
#include <sys/stat.h>
#include <unistd.h>

#include <filesystem>
#include <vector>

#include "common/error.hpp"
#include "plugins/elf_file.hpp"
#include "plugins/trusted_file.hpp"

namespace rtcf::executor {

namespace {

class LinkCheck {
   public:
    LinkCheck(const std::string& library, const std::set<uid_t>& owners)
        : library_(library), owners_(owners) {}

    /// @param origin value of $ORIGIN in the loader
    /// @param inherited RPATH of the libraries that link against this one
    void check(int file, const std::string& origin, const std::vector<std::string>& inherited) {
        const ElfFile section(file);
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
        } catch (const Error&) {
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
            const std::string entry = run_path.substr(begin, end - begin);
            // Run paths of build trees end in an empty entry, which the loader takes for the
            // current folder.
            folders.push_back(entry.empty() ? std::filesystem::current_path().string()
                                            : expanded(entry, origin));
            requireTrustedFolder(
                folders.back(), owners_,
                fmt::format("library {}, with {}{} in its run path", library_,
                            entry.empty() ? "an empty entry, thus " : "", folders.back()));
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
        if (folder.empty() || folder.front() != '/' || folder.find('$') != std::string::npos)
            refuse(
                fmt::format("its run path contains \"{}\", which is not an absolute path", folder));
        return folder;
    }

    [[noreturn]] void refuse(const std::string& why) const {
        throw Error(ErrorKind::LibraryRejected,
                    fmt::format("library {}: {}: build the library without it", library_, why));
    }

    const std::string& library_;
    const std::set<uid_t>& owners_;
    std::set<std::string> seen_;
};

}  // namespace

void requireTrustedLinks(const std::string& path, int file, const std::set<uid_t>& owners) {
    // The loader loads a copy, see Library.
    LinkCheck(path, owners).check(file, fmt::format("/proc/{}/fd", ::getpid()), {});
}

std::set<std::string> loadedFiles() {
    std::set<std::string> files;
    ::dl_iterate_phdr(
        [](dl_phdr_info* info, std::size_t, void* data) {
            // Skips the program itself, the kernel's vdso, and our copies.
            const std::string name = info->dlpi_name;
            if (name.rfind('/', 0) == 0 && name.rfind("/proc/", 0) != 0)
                static_cast<std::set<std::string>*>(data)->insert(name);
            return 0;
        },
        &files);
    return files;
}

}  // namespace rtcf::executor

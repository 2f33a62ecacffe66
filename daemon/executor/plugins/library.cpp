#include "plugins/library.hpp"

#include <dlfcn.h>
#include <fmt/format.h>
#include <sys/mman.h>
#include <sys/sendfile.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <filesystem>

#include "common/error.hpp"
#include "plugins/elf_file.hpp"
#include "plugins/linked_files.hpp"
#include "plugins/trusted_file.hpp"
#include "realtime/floating_point.hpp"

namespace rtcf::executor {

namespace {

class FileDescriptor {
   public:
    explicit FileDescriptor(int fd) : fd_(fd) {}
    ~FileDescriptor() {
        if (fd_ >= 0) ::close(fd_);
    }
    FileDescriptor(const FileDescriptor&) = delete;
    FileDescriptor& operator=(const FileDescriptor&) = delete;
    int get() const noexcept { return fd_; }
    int release() noexcept { return std::exchange(fd_, -1); }

   private:
    int fd_;
};

[[noreturn]] void refuse(const std::string& path, const std::string& why) {
    throw Error(ErrorKind::LibraryRejected, fmt::format("library {}: {}", path, why));
}

std::string systemError() { return std::strerror(errno); }

struct stat statusOf(const std::string& path, int file) {
    struct stat status{};
    if (::fstat(file, &status) != 0) refuse(path, systemError());
    return status;
}

// Copies the file so that other processes cannot change it. The copy is in memory, because /run is
// often mounted noexec.
int privateCopy(const std::string& path, int source) {
    const struct stat status = statusOf(path, source);
    const std::string name = std::filesystem::path(path).filename();
    FileDescriptor copy(::memfd_create(name.c_str(), MFD_CLOEXEC));
    if (copy.get() < 0) refuse(path, "no memory for a copy: " + systemError());
    for (off_t left = status.st_size; left > 0;) {
        const ssize_t moved =
            ::sendfile(copy.get(), source, nullptr, static_cast<std::size_t>(left));
        if (moved <= 0)
            refuse(path, moved == 0 ? "the file changed while it was read" : systemError());
        left -= moved;
    }
    return copy.release();
}

// A loaded copy, which is unloaded unless keep() is called.
class OpenCopy {
   public:
    OpenCopy(const std::string& path, int file)
        : copy_(privateCopy(path, file)),
          name_(fmt::format("/proc/{}/fd/{}", ::getpid(), copy_.get())),
          handle_(open(name_)) {
        if (handle_ == nullptr) refuseUnloadable(path, ::dlerror());
    }
    ~OpenCopy() {
        if (handle_ == nullptr) return;
        ::dlclose(handle_);
        // If the loader keeps the library loaded, keep the descriptor open, so that the name stays
        // unique.
        if (void* still = ::dlopen(name_.c_str(), RTLD_NOW | RTLD_NOLOAD); still != nullptr) {
            ::dlclose(still);
            (void)copy_.release();
        }
    }
    OpenCopy(const OpenCopy&) = delete;
    OpenCopy& operator=(const OpenCopy&) = delete;

    void* handle() const noexcept { return handle_; }
    // The descriptor stays open for the life of the process: debuggers and
    // sanitizers find the symbols by this name, and it keeps the name unique.
    void* keep() noexcept {
        (void)copy_.release();
        return std::exchange(handle_, nullptr);
    }

   private:
    static void* open(const std::string& name) {
        // A library linked with -ffast-math changes the floating-point environment when it is
        // loaded.
        const FloatingPointKeeper floating_point;
        return ::dlopen(name.c_str(), RTLD_NOW | RTLD_LOCAL);
    }

    [[noreturn]] void refuseUnloadable(const std::string& path, std::string why) const {
        const std::string& copy_path = name_;
        for (std::size_t at = why.find(copy_path); at != std::string::npos;
             at = why.find(copy_path)) {
            why.replace(at, copy_path.size(), std::filesystem::path(path).filename());
        }
        refuse(path,
               "does not load: " + why + "; link the libraries that it needs and build it again");
    }

    FileDescriptor copy_;
    std::string name_;
    void* handle_;
};

// Rejects thread_local variables that the real-time thread would allocate in a cycle.
void requireNoLazyThreadLocals(const std::string& path, int file) {
    if (!ElfFile(file).lazy_thread_locals) return;
    refuse(
        path,
        "has thread_local variables, which are allocated in the cycle that first uses them: make "
        "them members of the component, or build with -ftls-model=initial-exec, which reserves "
        "their memory in advance");
}

}  // namespace

Library::Library(const std::string& path, int file) : path_(path) {
    OpenCopy copy(path, file);
    using EntryPoint = const PluginDescriptor* (*)();
    const auto entry = reinterpret_cast<EntryPoint>(::dlsym(copy.handle(), RTCF_ENTRY_POINT_NAME));
    if (entry == nullptr) {
        refuse(path, "has no components: it exports no " RTCF_ENTRY_POINT_NAME
                     "; register them with RTCF_COMPONENT and build with rtcf_add_components()");
    }
    const PluginDescriptor* descriptor = entry();
    const std::uint32_t ours = AbiProbe::fingerprint(RTCF_ABI_VERSION);
    if (descriptor->abi_version != ours) {
        refuse(
            path,
            fmt::format("was built for component ABI {}, this executor has {}: build it again with "
                        "librtcf-dev {}, and without options that change layouts, as "
                        "-D_GLIBCXX_DEBUG does",
                        descriptor->abi_version, ours, RTCF_VERSION));
    }
    for (const ComponentRecord* record = descriptor->components; record != nullptr;
         record = record->next) {
        types_.push_back(record);
    }
    std::sort(types_.begin(), types_.end(),
              [](const auto* a, const auto* b) { return std::strcmp(a->type, b->type) < 0; });
    const auto twice = std::adjacent_find(
        types_.begin(), types_.end(),
        [](const auto* a, const auto* b) { return std::strcmp(a->type, b->type) == 0; });
    if (twice != types_.end()) {
        refuse(path, fmt::format(R"(registers the type {} twice ("{}" and "{}"): rename one)",
                                 (*twice)->type, (*twice)->doc, twice[1]->doc));
    }
    handle_ = copy.keep();
}

const ComponentRecord* Library::find(const std::string& type) const noexcept {
    for (const ComponentRecord* record : types_) {
        if (type == record->type) return record;
    }
    return nullptr;
}

LibraryStore::LibraryStore() : owners_{::geteuid()}, linked_(loadedFiles()) {}

std::shared_ptr<const Library> LibraryStore::open(const std::string& path) {
    const FileDescriptor file(openTrusted(path, owners_));
    const struct stat status = statusOf(path, file.get());
    const std::string identity =
        fmt::format("{} {} {} {}.{:09} {}", path, status.st_dev, status.st_ino,
                    status.st_mtim.tv_sec, status.st_mtim.tv_nsec, status.st_size);
    for (const Entry& entry : entries_) {
        if (entry.identity != identity) continue;
        requireTrustedFinds(path);
        return entry.library;
    }
    requireTrustedLinks(path, file.get(), owners_);
    requireNoLazyThreadLocals(path, file.get());
    entries_.push_back({identity, std::make_shared<const Library>(path, file.get())});
    requireTrustedFinds(path);
    return entries_.back().library;
}

// Checks libraries that the loader found in folders that were not checked before. They stay loaded;
// every later request for the library checks them again.
void LibraryStore::requireTrustedFinds(const std::string& path) {
    for (const std::string& linked : loadedFiles()) {
        if (linked_.count(linked) != 0) continue;
        const FileDescriptor trusted(openTrusted(
            linked, owners_, fmt::format("library {}, which links against {}", path, linked)));
        linked_.insert(linked);
    }
}

}  // namespace rtcf::executor

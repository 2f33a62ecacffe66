#include "realtime/thread_locals.hpp"

#include <dlfcn.h>
#include <link.h>

#include <algorithm>
#include <set>
#include <thread>
#include <utility>

// The function that compilers call for a thread_local variable. It is part of the ABI, but in no
// header (ELF Handling For Thread-Local Storage, 3.4).
struct TlsIndex {
    unsigned long module;
    unsigned long offset;
};
extern "C" void* __tls_get_addr(TlsIndex*);  // NOLINT(bugprone-reserved-identifier)

namespace rtcf::executor {

namespace {

const link_map* mapOf(void* library) {
    link_map* map = nullptr;
    return dlinfo(library, RTLD_DI_LINKMAP, static_cast<void*>(&map)) == 0 ? map : nullptr;
}

// Names of the libraries that a library needs.
std::vector<const char*> neededBy(const link_map& library) {
    const ElfW(Dyn)* const entries = library.l_ld;
    ElfW(Addr) strings = 0;
    for (const ElfW(Dyn)* entry = entries; entry->d_tag != DT_NULL; ++entry) {
        if (entry->d_tag == DT_STRTAB) strings = entry->d_un.d_ptr;
    }
    // The loader has converted the offset to an address, unless the section is read-only.
    if (strings < library.l_addr) strings += library.l_addr;
    std::vector<const char*> names;
    for (const ElfW(Dyn)* entry = entries; entry->d_tag != DT_NULL; ++entry) {
        if (entry->d_tag != DT_NEEDED && entry->d_tag != DT_FILTER && entry->d_tag != DT_AUXILIARY)
            continue;
        // NOLINTNEXTLINE(performance-no-int-to-ptr): the loader gives addresses as numbers
        names.push_back(reinterpret_cast<const char*>(strings + entry->d_un.d_val));
    }
    return names;
}

// Collects a library and all libraries that it links against, directly or not. The loader resolves
// a needed name to the library that it has already loaded for it.
void collect(HeldLibrary library, std::set<const link_map*>& seen,
             std::vector<HeldLibrary>& libraries) {
    const link_map* const map = library.handle() == nullptr ? nullptr : mapOf(library.handle());
    if (map == nullptr || !seen.insert(map).second) return;
    libraries.push_back(std::move(library));
    for (const char* name : neededBy(*map)) collect(HeldLibrary(name), seen, libraries);
}

// Modules whose memory a thread has from its start, in its static TLS. The loader also puts them
// there in existing threads when it loads a library.
std::set<std::size_t> modulesOfNewThread() {
    std::set<std::size_t> modules;
    std::thread([&modules] {
        dl_iterate_phdr(
            [](dl_phdr_info* info, std::size_t, void* found) {
                if (info->dlpi_tls_modid != 0 && info->dlpi_tls_data != nullptr)
                    static_cast<std::set<std::size_t>*>(found)->insert(info->dlpi_tls_modid);
                return 0;
            },
            &modules);
    }).join();
    return modules;
}

}  // namespace

HeldLibrary::HeldLibrary(const char* name) : handle_(dlopen(name, RTLD_LAZY | RTLD_NOLOAD)) {
    if (handle_ != nullptr) dlinfo(handle_, RTLD_DI_TLS_MODID, &module_);
}

HeldLibrary::~HeldLibrary() {
    if (handle_ != nullptr) dlclose(handle_);
}

HeldLibrary::HeldLibrary(HeldLibrary&& other) noexcept
    : handle_(std::exchange(other.handle_, nullptr)), module_(other.module_) {}

ThreadLocals::ThreadLocals() {
    std::vector<std::string> names;
    dl_iterate_phdr(
        [](dl_phdr_info* info, std::size_t, void* found) {
            // Skips the program itself, which has no name: all threads have its memory.
            if (info->dlpi_tls_modid != 0 && *info->dlpi_name != '\0')
                static_cast<std::vector<std::string>*>(found)->emplace_back(info->dlpi_name);
            return 0;
        },
        &names);
    // Not in the callback, which runs under the loader's lock. A library that another thread has
    // closed since is skipped.
    for (const std::string& name : names) {
        HeldLibrary library(name.c_str());
        if (library.module() != 0) held_.push_back(std::move(library));
    }
}

unsigned long long ThreadLocals::loads() noexcept {
    unsigned long long loads = 0;
    dl_iterate_phdr(
        [](dl_phdr_info* info, std::size_t, void* count) {
            *static_cast<unsigned long long*>(count) = info->dlpi_adds;
            return 1;
        },
        &loads);
    return loads;
}

void ThreadLocals::touch() const noexcept {
    for (const HeldLibrary& library : held_) {
        TlsIndex first{library.module(), 0};
        (void)__tls_get_addr(&first);
    }
}

std::string ThreadLocals::lacking(void* library) const {
    const link_map* const map = mapOf(library);
    if (map == nullptr) return {};
    std::set<const link_map*> seen;
    std::vector<HeldLibrary> libraries;
    collect(HeldLibrary(map->l_name), seen, libraries);
    std::vector<const HeldLibrary*> others;
    for (const HeldLibrary& linked : libraries) {
        if (linked.module() != 0 && !holds(linked.module())) others.push_back(&linked);
    }
    if (others.empty()) return {};
    const std::set<std::size_t> of_all = modulesOfNewThread();
    for (const HeldLibrary* other : others) {
        if (of_all.count(other->module()) == 0) return mapOf(other->handle())->l_name;
    }
    return {};
}

bool ThreadLocals::holds(std::size_t module) const noexcept {
    return std::any_of(held_.begin(), held_.end(),
                       [module](const HeldLibrary& held) { return held.module() == module; });
}

}  // namespace rtcf::executor

/// @file
/// Memory of thread_local variables in shared libraries. The loader allocates a library's variables
/// when a thread first uses one, with malloc() and under its locks. So threads that run cycles
/// allocate them in advance. Not real-time.
#pragma once

#include <cstddef>
#include <string>
#include <vector>

namespace rtcf::executor {

/// Keeps a library loaded for the life of this object.
class HeldLibrary {
   public:
    /// @param name the loader's name of the library; if there is none of that name, nothing is held
    explicit HeldLibrary(const char* name);
    ~HeldLibrary();
    HeldLibrary(HeldLibrary&& other) noexcept;
    HeldLibrary& operator=(HeldLibrary&&) = delete;
    HeldLibrary(const HeldLibrary&) = delete;
    HeldLibrary& operator=(const HeldLibrary&) = delete;

    /// Handle of dlopen(); null = nothing is held.
    void* handle() const noexcept { return handle_; }
    /// The loader's TLS module id of the library; 0 = it has no thread_local variables.
    std::size_t module() const noexcept { return module_; }

   private:
    void* handle_;
    std::size_t module_ = 0;
};

/// The libraries with thread_local variables that are loaded when this object is made. It keeps
/// them loaded: the loader reuses the module id of an unloaded library, and each thread that
/// notices frees the memory.
class ThreadLocals {
   public:
    ThreadLocals();

    /// Number of libraries loaded so far; it changes with every load.
    static unsigned long long loads() noexcept;

    /// Allocates the calling thread's variables of all these libraries. Any thread.
    void touch() const noexcept;
    /// @param library handle of dlopen(), open during the call
    /// @return the file of the first library, among this one and those that it links against, whose
    /// variables a running thread has no memory of although it has called touch(); empty = none
    std::string lacking(void* library) const;

   private:
    bool holds(std::size_t module) const noexcept;

    std::vector<HeldLibrary> held_;
};

}  // namespace rtcf::executor

/// @file
/// Memory of shared libraries' thread_local variables. The loader gets a library's when a thread
/// first uses one of them, by malloc() and under locks of its own: threads that run cycles have it
/// before. Not real-time.
#pragma once

#include <cstddef>
#include <string>
#include <vector>

namespace rtcf::executor {

/// A library that stays loaded as long as this lives.
class HeldLibrary {
   public:
    /// @param name as the loader has it; nothing is held if it has none of that name
    explicit HeldLibrary(const char* name);
    ~HeldLibrary();
    HeldLibrary(HeldLibrary&& other) noexcept;
    HeldLibrary& operator=(HeldLibrary&&) = delete;
    HeldLibrary(const HeldLibrary&) = delete;
    HeldLibrary& operator=(const HeldLibrary&) = delete;

    /// Of dlopen(); null = nothing is held.
    void* handle() const noexcept { return handle_; }
    /// The loader's number for its thread_local variables; 0 = it has none.
    std::size_t module() const noexcept { return module_; }

   private:
    void* handle_;
    std::size_t module_ = 0;
};

/// The libraries that are loaded when this is made and have thread_local variables. None goes
/// before this does: the loader gives the number of one that is gone to the next that comes, and
/// has its memory freed by each thread that notices.
class ThreadLocals {
   public:
    ThreadLocals();

    /// How many libraries have been loaded so far: another number, other libraries.
    static unsigned long long loads() noexcept;

    /// Gets the calling thread its memory of all of them. Any thread.
    void touch() const noexcept;
    /// @param library of dlopen(); stays open meanwhile
    /// @return the file of the first library, of this one and all that it links against, whose
    /// variables a thread that lives, and has called touch(), has no memory of; empty = none
    std::string lacking(void* library) const;

   private:
    bool holds(std::size_t module) const noexcept;

    std::vector<HeldLibrary> held_;
};

}  // namespace rtcf::executor

/// @file
/// The floating-point environment of cycles: the IEEE 754 defaults of a plain program, with
/// rounding to nearest, no traps, and no flush-to-zero. So a component computes the same bits in
/// real time, in steps, in a replay and in its own tests. The environment belongs to a thread and
/// is inherited by threads; loading a library built with -ffast-math changes it.
#pragma once

#include <cfenv>
#if defined(__x86_64__)
#include <xmmintrin.h>
#endif

namespace rtcf::executor {

/// Sets the environment of the calling thread. Real-time safe.
inline void setFloatingPointDefaults() noexcept {
    std::fesetenv(FE_DFL_ENV);
#if defined(__x86_64__)
    _mm_setcsr(0x1f80);  // for C libraries whose fesetenv() does not reset flush-to-zero
#endif
}

/// Saves the calling thread's environment, and restores it in the destructor.
class FloatingPointKeeper {
   public:
    FloatingPointKeeper() noexcept { std::fegetenv(&kept_); }
    ~FloatingPointKeeper() { std::fesetenv(&kept_); }
    FloatingPointKeeper(const FloatingPointKeeper&) = delete;
    FloatingPointKeeper& operator=(const FloatingPointKeeper&) = delete;

   private:
    std::fenv_t kept_{};
};

/// Sets the environment for cycles in a thread that also does other work, and restores it in the
/// destructor.
class FloatingPointDefaults : private FloatingPointKeeper {
   public:
    FloatingPointDefaults() noexcept { setFloatingPointDefaults(); }
};

}  // namespace rtcf::executor

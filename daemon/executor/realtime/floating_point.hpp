/// @file
/// The floating-point environment of cycles: IEEE 754 as a plain program has it,
/// rounding to nearest, no traps, and no flush-to-zero, so that a component
/// computes in real time, in steps and in a replay what it computes in a test
/// of its own. It belongs to a thread, is inherited, and is changed by
/// libraries built with -ffast-math when they are loaded.
#pragma once

#include <cfenv>
#if defined(__x86_64__)
#include <xmmintrin.h>
#endif

namespace rtcf::executor {

/// Sets it for the calling thread. Real-time safe.
inline void setFloatingPointDefaults() noexcept {
    std::fesetenv(FE_DFL_ENV);
#if defined(__x86_64__)
    _mm_setcsr(0x1f80);  // also where a C library leaves flush-to-zero alone
#endif
}

/// Keeps the calling thread's environment, and brings it back.
class FloatingPointKeeper {
   public:
    FloatingPointKeeper() noexcept { std::fegetenv(&kept_); }
    ~FloatingPointKeeper() { std::fesetenv(&kept_); }
    FloatingPointKeeper(const FloatingPointKeeper&) = delete;
    FloatingPointKeeper& operator=(const FloatingPointKeeper&) = delete;

   private:
    std::fenv_t kept_{};
};

/// Has cycles in a thread that does other things besides.
class FloatingPointDefaults : private FloatingPointKeeper {
   public:
    FloatingPointDefaults() noexcept { setFloatingPointDefaults(); }
};

}  // namespace rtcf::executor

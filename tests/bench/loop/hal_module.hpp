/// @file
/// Runs a component of LinuxCNC HAL in this process, without HAL's threads and shared memory. The
/// module is LinuxCNC's own; this class has only the functions by which a module declares its pins
/// and functions.
#pragma once

#include <string>

namespace rtcf::bench {

/// One loaded module with one instance of its component. At most one per module file.
class HalModule {
   public:
    /// @param file path of the module, e.g. /usr/lib/linuxcnc/modules/pid.so
    /// @throws std::runtime_error if it cannot be loaded
    explicit HalModule(const std::string& file);

    /// A pin or parameter of the type float.
    /// @throws std::runtime_error if there is none with this name
    volatile double& number(const std::string& name) const;
    /// A pin of the type bit.
    volatile bool& bit(const std::string& name) const;
    /// A pin of the type u32.
    volatile unsigned& whole(const std::string& name) const;

    /// Calls the function of the instance.
    void update(long period_ns) const { function_(argument_, period_ns); }

   private:
    void (*function_)(void*, long) = nullptr;
    void* argument_ = nullptr;
};

}  // namespace rtcf::bench

#include "control/allocations.hpp"

#include <cstdlib>

#ifndef RTCF_SANITIZED
namespace {
bool counting = false;  // the tests have one thread
std::size_t count = 0;
}  // namespace

// glibc's own malloc(), which the function below hides.
// NOLINTNEXTLINE(bugprone-reserved-identifier)
extern "C" void* __libc_malloc(std::size_t size);
extern "C" void* malloc(std::size_t size) noexcept {
    count += counting ? 1 : 0;
    return __libc_malloc(size);
}
#endif

namespace rtcf::test {
namespace {

void updateInLoop(Component& component) noexcept RTCF_NONBLOCKING { component.update(); }

}  // namespace

std::size_t allocationsInUpdate(Component& component) {
    accessTo(component).context().log_level = LogLevel::Fatal;
#ifdef RTCF_SANITIZED
    updateInLoop(component);
    return 0;
#else
    count = 0;
    counting = true;
    updateInLoop(component);
    counting = false;
    return count;
#endif
}

}  // namespace rtcf::test

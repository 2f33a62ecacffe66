#include "logging/log_errors.hpp"

#include <fmt/format.h>

#include <exception>

#include "common/thrown.hpp"

namespace rtcf::executor {

void logErrors(Log& log, const char* what, const std::function<void()>& work) noexcept {
    try {
        try {
            work();
        } catch (const std::exception& error) {
            log.write(LogLevel::Error, {}, fmt::format("{} failed: {}", what, textOf(error)));
        }
    } catch (...) {
        // Logging failed, too.
    }
}

}  // namespace rtcf::executor

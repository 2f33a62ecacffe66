/// @file
/// The one exception by which the executor says no. Its text is one line for a
/// person: what, where, how to mend it. A refused change has changed nothing.
#pragma once

#include <stdexcept>
#include <string>

namespace rtcf::executor {

enum class RefusalKind {
    InvalidArgument,
    NotFound,
    AlreadyExists,
    FailedPrecondition,
    Unavailable,
    NoMaster,
    ResourceExhausted
};

class Refusal : public std::runtime_error {
   public:
    Refusal(RefusalKind kind, const std::string& message)
        : std::runtime_error(message), kind_(kind) {}
    RefusalKind kind() const noexcept { return kind_; }

   private:
    RefusalKind kind_;
};

}  // namespace rtcf::executor

/// @file
/// The executor's exception for errors in requests. Its text is one line for a person: the error,
/// the names, and how to correct it. A rejected change has changed nothing.
#pragma once

#include <stdexcept>
#include <string>

namespace rtcf::executor {

/// Error kind, for programs. messages/errors.cpp maps each kind to a reason and a status code.
enum class ErrorKind {
    InvalidArgument,  ///< a value is out of range or of the wrong type
    RequestMalformed,
    NameMissing,
    NameInvalid,
    TextTooLong,
    ExpressionInvalid,
    ComponentTwice,
    RatesConflict,
    RecordingInvalid,

    NotFound,  ///< no such component
    PortNotFound,
    ParameterNotFound,
    TypeNotFound,

    AlreadyExists,

    FailedPrecondition,
    TypesDiffer,
    ConnectionsFormLoop,
    TwoWriters,
    TwoPacers,
    LibraryRejected,
    HookFailed,
    NoMaster,
    NoRealtime,
    NoState,
    LoopRuns,
    LoopFailed,
    LoopStopped,
    ReplayRuns,
    NoReplay,

    Unavailable,  ///< the loop reaches no boundary
    HookStuck,    ///< a hook does not return

    ResourceExhausted,
    StateTooLarge
};

class Error : public std::runtime_error {
   public:
    Error(ErrorKind kind, const std::string& message) : std::runtime_error(message), kind_(kind) {}
    ErrorKind kind() const noexcept { return kind_; }

   private:
    ErrorKind kind_;
};

}  // namespace rtcf::executor

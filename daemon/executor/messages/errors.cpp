#include "messages/errors.hpp"

#include <fmt/format.h>

namespace rtcf::executor {

namespace pb = ::rtcf::v1;

namespace {

std::pair<v1::Error::Code, pb::Reason> codeAndReason(ErrorKind kind) {
    switch (kind) {
        case ErrorKind::RequestMalformed:
            return {v1::Error::CODE_INVALID_ARGUMENT, pb::REASON_REQUEST_MALFORMED};
        case ErrorKind::InvalidArgument:
            return {v1::Error::CODE_INVALID_ARGUMENT, pb::REASON_VALUE_INVALID};
        case ErrorKind::NameMissing:
            return {v1::Error::CODE_INVALID_ARGUMENT, pb::REASON_NAME_MISSING};
        case ErrorKind::NameInvalid:
            return {v1::Error::CODE_INVALID_ARGUMENT, pb::REASON_NAME_INVALID};
        case ErrorKind::TextTooLong:
            return {v1::Error::CODE_INVALID_ARGUMENT, pb::REASON_TEXT_TOO_LONG};
        case ErrorKind::ExpressionInvalid:
            return {v1::Error::CODE_INVALID_ARGUMENT, pb::REASON_EXPRESSION_INVALID};
        case ErrorKind::ComponentTwice:
            return {v1::Error::CODE_INVALID_ARGUMENT, pb::REASON_COMPONENT_TWICE};
        case ErrorKind::RatesConflict:
            return {v1::Error::CODE_INVALID_ARGUMENT, pb::REASON_RATES_CONFLICT};
        case ErrorKind::RecordingInvalid:
            return {v1::Error::CODE_INVALID_ARGUMENT, pb::REASON_RECORDING_INVALID};
        case ErrorKind::NotFound:
            return {v1::Error::CODE_NOT_FOUND, pb::REASON_COMPONENT_NOT_FOUND};
        case ErrorKind::PortNotFound:
            return {v1::Error::CODE_NOT_FOUND, pb::REASON_PORT_NOT_FOUND};
        case ErrorKind::ParameterNotFound:
            return {v1::Error::CODE_NOT_FOUND, pb::REASON_PARAMETER_NOT_FOUND};
        case ErrorKind::TypeNotFound:
            return {v1::Error::CODE_NOT_FOUND, pb::REASON_TYPE_NOT_FOUND};
        case ErrorKind::AlreadyExists:
            return {v1::Error::CODE_ALREADY_EXISTS, pb::REASON_COMPONENT_EXISTS};
        case ErrorKind::FailedPrecondition:
            return {v1::Error::CODE_FAILED_PRECONDITION, pb::REASON_COMPONENT_REFUSED};
        case ErrorKind::TypesDiffer:
            return {v1::Error::CODE_FAILED_PRECONDITION, pb::REASON_TYPES_DIFFER};
        case ErrorKind::ConnectionsFormLoop:
            return {v1::Error::CODE_FAILED_PRECONDITION, pb::REASON_CONNECTIONS_FORM_LOOP};
        case ErrorKind::TwoWriters:
            return {v1::Error::CODE_FAILED_PRECONDITION, pb::REASON_TWO_WRITERS};
        case ErrorKind::TwoPacers:
            return {v1::Error::CODE_FAILED_PRECONDITION, pb::REASON_TWO_PACERS};
        case ErrorKind::LibraryRejected:
            return {v1::Error::CODE_FAILED_PRECONDITION, pb::REASON_LIBRARY_REFUSED};
        case ErrorKind::HookFailed:
            return {v1::Error::CODE_FAILED_PRECONDITION, pb::REASON_HOOK_FAILED};
        case ErrorKind::NoMaster:
            return {v1::Error::CODE_NO_MASTER, pb::REASON_NO_MASTER};
        case ErrorKind::NoRealtime:
            return {v1::Error::CODE_FAILED_PRECONDITION, pb::REASON_NO_REALTIME};
        case ErrorKind::NoState:
            return {v1::Error::CODE_FAILED_PRECONDITION, pb::REASON_NO_STATE};
        case ErrorKind::LoopRuns:
            return {v1::Error::CODE_FAILED_PRECONDITION, pb::REASON_LOOP_RUNS};
        case ErrorKind::LoopFailed:
            return {v1::Error::CODE_FAILED_PRECONDITION, pb::REASON_LOOP_FAILED};
        case ErrorKind::LoopStopped:
            return {v1::Error::CODE_FAILED_PRECONDITION, pb::REASON_LOOP_STOPPED};
        case ErrorKind::ReplayRuns:
            return {v1::Error::CODE_FAILED_PRECONDITION, pb::REASON_REPLAY_RUNS};
        case ErrorKind::NoReplay:
            return {v1::Error::CODE_FAILED_PRECONDITION, pb::REASON_NO_REPLAY};
        case ErrorKind::Unavailable:
            return {v1::Error::CODE_UNAVAILABLE, pb::REASON_LOOP_STUCK};
        case ErrorKind::HookStuck:
            return {v1::Error::CODE_UNAVAILABLE, pb::REASON_HOOK_STUCK};
        case ErrorKind::ResourceExhausted:
            return {v1::Error::CODE_RESOURCE_EXHAUSTED, pb::REASON_LIMIT_REACHED};
        case ErrorKind::StateTooLarge:
            return {v1::Error::CODE_RESOURCE_EXHAUSTED, pb::REASON_STATE_TOO_LARGE};
    }
    return {v1::Error::CODE_FAILED_PRECONDITION, pb::REASON_COMPONENT_REFUSED};
}

}  // namespace

v1::Error errorTo(ErrorKind kind, const std::string& message) {
    v1::Error error;
    const auto [code, reason] = codeAndReason(kind);
    error.set_code(code);
    error.set_reason(reason);
    error.set_message(message);
    return error;
}

v1::Response errorResponse(std::uint64_t id, ErrorKind kind, const std::string& message) {
    v1::Response response;
    response.set_id(id);
    *response.mutable_error() = errorTo(kind, message);
    return response;
}

}  // namespace rtcf::executor

#include "messages/errors.hpp"

#include <fmt/format.h>

namespace rtcf::executor {

namespace pb = ::rtcf::v1;

namespace {

std::pair<v1::Error::Code, pb::Reason> codeAndReason(RefusalKind kind) {
    switch (kind) {
        case RefusalKind::RequestMalformed:
            return {v1::Error::CODE_INVALID_ARGUMENT, pb::REASON_REQUEST_MALFORMED};
        case RefusalKind::InvalidArgument:
            return {v1::Error::CODE_INVALID_ARGUMENT, pb::REASON_VALUE_INVALID};
        case RefusalKind::NameMissing:
            return {v1::Error::CODE_INVALID_ARGUMENT, pb::REASON_NAME_MISSING};
        case RefusalKind::NameInvalid:
            return {v1::Error::CODE_INVALID_ARGUMENT, pb::REASON_NAME_INVALID};
        case RefusalKind::TextTooLong:
            return {v1::Error::CODE_INVALID_ARGUMENT, pb::REASON_TEXT_TOO_LONG};
        case RefusalKind::ExpressionInvalid:
            return {v1::Error::CODE_INVALID_ARGUMENT, pb::REASON_EXPRESSION_INVALID};
        case RefusalKind::ComponentTwice:
            return {v1::Error::CODE_INVALID_ARGUMENT, pb::REASON_COMPONENT_TWICE};
        case RefusalKind::RatesConflict:
            return {v1::Error::CODE_INVALID_ARGUMENT, pb::REASON_RATES_CONFLICT};
        case RefusalKind::RecordingInvalid:
            return {v1::Error::CODE_INVALID_ARGUMENT, pb::REASON_RECORDING_INVALID};
        case RefusalKind::NotFound:
            return {v1::Error::CODE_NOT_FOUND, pb::REASON_COMPONENT_NOT_FOUND};
        case RefusalKind::PortNotFound:
            return {v1::Error::CODE_NOT_FOUND, pb::REASON_PORT_NOT_FOUND};
        case RefusalKind::ParameterNotFound:
            return {v1::Error::CODE_NOT_FOUND, pb::REASON_PARAMETER_NOT_FOUND};
        case RefusalKind::TypeNotFound:
            return {v1::Error::CODE_NOT_FOUND, pb::REASON_TYPE_NOT_FOUND};
        case RefusalKind::AlreadyExists:
            return {v1::Error::CODE_ALREADY_EXISTS, pb::REASON_COMPONENT_EXISTS};
        case RefusalKind::FailedPrecondition:
            return {v1::Error::CODE_FAILED_PRECONDITION, pb::REASON_COMPONENT_REFUSED};
        case RefusalKind::TypesDiffer:
            return {v1::Error::CODE_FAILED_PRECONDITION, pb::REASON_TYPES_DIFFER};
        case RefusalKind::ConnectionsFormLoop:
            return {v1::Error::CODE_FAILED_PRECONDITION, pb::REASON_CONNECTIONS_FORM_LOOP};
        case RefusalKind::TwoWriters:
            return {v1::Error::CODE_FAILED_PRECONDITION, pb::REASON_TWO_WRITERS};
        case RefusalKind::TwoPacers:
            return {v1::Error::CODE_FAILED_PRECONDITION, pb::REASON_TWO_PACERS};
        case RefusalKind::LibraryRefused:
            return {v1::Error::CODE_FAILED_PRECONDITION, pb::REASON_LIBRARY_REFUSED};
        case RefusalKind::HookFailed:
            return {v1::Error::CODE_FAILED_PRECONDITION, pb::REASON_HOOK_FAILED};
        case RefusalKind::NoMaster:
            return {v1::Error::CODE_NO_MASTER, pb::REASON_NO_MASTER};
        case RefusalKind::NoRealtime:
            return {v1::Error::CODE_FAILED_PRECONDITION, pb::REASON_NO_REALTIME};
        case RefusalKind::NoState:
            return {v1::Error::CODE_FAILED_PRECONDITION, pb::REASON_NO_STATE};
        case RefusalKind::LoopRuns:
            return {v1::Error::CODE_FAILED_PRECONDITION, pb::REASON_LOOP_RUNS};
        case RefusalKind::LoopFailed:
            return {v1::Error::CODE_FAILED_PRECONDITION, pb::REASON_LOOP_FAILED};
        case RefusalKind::LoopStopped:
            return {v1::Error::CODE_FAILED_PRECONDITION, pb::REASON_LOOP_STOPPED};
        case RefusalKind::ReplayRuns:
            return {v1::Error::CODE_FAILED_PRECONDITION, pb::REASON_REPLAY_RUNS};
        case RefusalKind::NoReplay:
            return {v1::Error::CODE_FAILED_PRECONDITION, pb::REASON_NO_REPLAY};
        case RefusalKind::Unavailable:
            return {v1::Error::CODE_UNAVAILABLE, pb::REASON_LOOP_STUCK};
        case RefusalKind::ResourceExhausted:
            return {v1::Error::CODE_RESOURCE_EXHAUSTED, pb::REASON_LIMIT_REACHED};
        case RefusalKind::StateTooLarge:
            return {v1::Error::CODE_RESOURCE_EXHAUSTED, pb::REASON_STATE_TOO_LARGE};
    }
    return {v1::Error::CODE_FAILED_PRECONDITION, pb::REASON_COMPONENT_REFUSED};
}

}  // namespace

v1::Error errorTo(RefusalKind kind, const std::string& message) {
    v1::Error error;
    const auto [code, reason] = codeAndReason(kind);
    error.set_code(code);
    error.set_reason(reason);
    error.set_message(message);
    return error;
}

v1::Response errorResponse(std::uint64_t id, RefusalKind kind, const std::string& message) {
    v1::Response response;
    response.set_id(id);
    *response.mutable_error() = errorTo(kind, message);
    return response;
}

}  // namespace rtcf::executor

/// @file
/// Conversion of Error to the wire's errors, with a code and a reason for programs. Pure
/// functions.
#pragma once

#include <cstdint>
#include <string>

#include "common/error.hpp"
#include "rtcf/executor/v1/executor.pb.h"

namespace rtcf::executor {

v1::Error errorTo(ErrorKind kind, const std::string& message);
/// The response that ends request `id` with an error.
v1::Response errorResponse(std::uint64_t id, ErrorKind kind, const std::string& message);

}  // namespace rtcf::executor

/// @file
/// A listening unix socket.
#pragma once

#include <string>

namespace rtcf::executor {

/// Listens at a path, in the place of what an executor that was killed has left there.
/// @return the descriptor, not blocking, closed by exec @throws std::system_error
int listenOn(const std::string& path, int backlog);

}  // namespace rtcf::executor

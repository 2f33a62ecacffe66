/// @file
/// Fast reconnection to publishers on machines that became unreachable: within seconds. roscpp
/// itself takes minutes to detect a cut cable, retries every 20 s, and never retries without a
/// route.
#pragma once

namespace rtcf::ros1 {

/// Enables fast reconnection for all later connections of this process. Called once, before the
/// node starts; any thread.
void reconnectSoon() noexcept;

}  // namespace rtcf::ros1

/// @file
/// Connections to publishers on machines that cannot be reached any more: given up and made again
/// within seconds. roscpp by itself takes minutes to notice that a cable has been cut, tries again
/// each 20 s, and where there is no route at all never again.
#pragma once

namespace rtcf::ros1 {

/// Holds for all connections that this process's roscpp opens from now on. Once, before the node
/// starts; any thread.
void reconnectSoon() noexcept;

}  // namespace rtcf::ros1

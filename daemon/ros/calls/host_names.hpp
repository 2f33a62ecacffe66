/// @file
/// Addresses of hosts. A slow resolver may take longer than any caller may wait, so each name is
/// looked up once, in a separate thread, and the address is kept.
#pragma once

#include <chrono>
#include <memory>
#include <optional>
#include <string>

namespace rtcf::ros1 {

/// Owned by the master watch; one thread at a time. Not real-time.
class HostNames {
   public:
    HostNames();

    /// The numeric address of a host. Waits at most `patience` for a look-up.
    /// @return nothing if the address is not known by then
    std::optional<std::string> address(const std::string& host, std::chrono::milliseconds patience);

    /// Starts a new look-up, because the host does not answer at the known address. Returns at
    /// once; at most one look-up per 10 s.
    void doubt(const std::string& host);

   private:
    struct Shared;
    std::shared_ptr<Shared> shared_;  // shared with detached look-up threads
};

}  // namespace rtcf::ros1

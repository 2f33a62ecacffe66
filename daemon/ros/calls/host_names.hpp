/// @file
/// Addresses of hosts. Looking one up may take a slow resolver longer than anything here may wait:
/// each name is looked up once, by a thread of its own, and kept.
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

    /// The address of a host, numeric. One that is not known yet is looked up, and waited for as
    /// long as `patience`. @return nothing if it is not known by then
    std::optional<std::string> address(const std::string& host, std::chrono::milliseconds patience);

    /// The host does not answer there: what is known of it may be old. Any lookup goes on
    /// meanwhile; at most one each 10 s.
    void doubt(const std::string& host);

   private:
    struct Shared;
    std::shared_ptr<Shared> shared_;  // with lookups that nobody waits for any more
};

}  // namespace rtcf::ros1

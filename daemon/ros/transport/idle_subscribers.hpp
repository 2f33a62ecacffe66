/// @file
/// Detection of idle subscribers, which read none of their messages. Each keeps a message alive
/// that others have already read, so many of them exhaust the memory. They are disconnected only
/// when memory is scarce.
#pragma once

#include <ros/subscriber_link.h>

#include <boost/weak_ptr.hpp>
#include <chrono>
#include <cstddef>
#include <map>
#include <mutex>

namespace rtcf::ros1 {

/// The idle subscribers of the process. Any thread; not real-time.
class IdleSubscribers {
   public:
    static IdleSubscribers& ofProcess();

    /// True if network memory is scarce; only then subscribers are checked.
    static bool scarce();

    /// Notes a message added to a subscriber's queue. To be called while memory is scarce.
    /// @param before, after oldest queued message before and after the addition
    void note(const ros::SubscriberLinkPtr& link, const void* before, const void* after);

    /// If memory is scarce, disconnects subscribers that have read nothing for a second. They may
    /// subscribe again. Not for roscpp's threads, which hold locks.
    /// @return number of disconnected subscribers
    std::size_t disconnect();

   private:
    using Clock = std::chrono::steady_clock;
    struct Queue {
        boost::weak_ptr<ros::SubscriberLink> link;
        const void* oldest;
        Clock::time_point since;  // no message was read from this time
        Clock::time_point until;  // to this time
    };

    std::mutex mutex_;
    std::map<const ros::SubscriberLink*, Queue> queues_;  // used while memory is scarce
};

}  // namespace rtcf::ros1

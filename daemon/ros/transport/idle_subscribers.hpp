/// @file
/// Subscribers that take nothing of what they asked for. Each holds a message that no other holds
/// any more, so that enough of them use up the memory for all. Nobody is sent away for being slow
/// as long as there is room.
#pragma once

#include <ros/subscriber_link.h>

#include <boost/weak_ptr.hpp>
#include <chrono>
#include <cstddef>
#include <map>
#include <mutex>

namespace rtcf::ros1 {

/// Those of the process, as is the memory that they use up. Any thread; not real-time.
class IdleSubscribers {
   public:
    static IdleSubscribers& ofProcess();

    /// Memory for what waits is getting short: only then subscribers are looked at.
    static bool scarce();

    /// To be called for each message that is put into a subscriber's queue while memory is scarce.
    /// @param before, after the oldest that waited before and after that
    void note(const ros::SubscriberLinkPtr& link, const void* before, const void* after);

    /// Disconnects those that took nothing for a second, if memory is scarce. They may ask again.
    /// Not to be called by roscpp, which holds locks.
    /// @return how many
    std::size_t disconnect();

   private:
    using Clock = std::chrono::steady_clock;
    struct Queue {
        boost::weak_ptr<ros::SubscriberLink> link;
        const void* oldest;
        Clock::time_point since;  // nothing was taken between this
        Clock::time_point until;  // and this
    };

    std::mutex mutex_;
    std::map<const ros::SubscriberLink*, Queue> queues_;  // looked at while memory is scarce
};

}  // namespace rtcf::ros1

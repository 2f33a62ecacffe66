#include "ros/transport/reconnection.hpp"

#include <dlfcn.h>
#include <netinet/in.h>
#include <netinet/tcp.h>
#include <ros/subscription.h>
#include <ros/transport/transport_tcp.h>
#include <ros/transport_publisher_link.h>
#include <sys/socket.h>

#include <algorithm>
#include <atomic>

#include "ros/transport/bounded_transport.hpp"

namespace rtcf::ros1 {

namespace {

// TCP keep-alive: the first probe is sent after kSilence without data, further ones each kBetween;
// the connection ends after kUnanswered probes without an answer.
constexpr int kSilence = 1;     // s
constexpr int kBetween = 1;     // s
constexpr int kUnanswered = 3;  // probes
constexpr int kUnanswered_ms = 3000;
constexpr double kLongestPause = 1.0;  // s between two attempts

std::atomic<bool> soon{false};

void set(int socket, int level, int option, int value) {
    // If the kernel does not know the option, the connection keeps its defaults.
    setsockopt(socket, level, option, &value, sizeof value);
}

}  // namespace

void reconnectSoon() noexcept { soon = true; }

}  // namespace rtcf::ros1

namespace ros {

// These functions replace roscpp's functions of the same names.

void TransportTCP::setKeepAlive(bool use, std::uint32_t idle, std::uint32_t interval,
                                std::uint32_t count) {
    using namespace rtcf::ros1;
    // Only for connections opened here: a peer reopens its own, and dropping one here would leave
    // the peer waiting.
    const bool ours = soon && !connected_host_.empty();
    set(sock_, SOL_SOCKET, SO_KEEPALIVE, use ? 1 : 0);
    if (!use) return;
    set(sock_, IPPROTO_TCP, TCP_KEEPIDLE, ours ? kSilence : static_cast<int>(idle));
    set(sock_, IPPROTO_TCP, TCP_KEEPINTVL, ours ? kBetween : static_cast<int>(interval));
    set(sock_, IPPROTO_TCP, TCP_KEEPCNT, ours ? kUnanswered : static_cast<int>(count));
    if (ours) set(sock_, IPPROTO_TCP, TCP_USER_TIMEOUT, kUnanswered_ms);
}

void TransportPublisherLink::onRetryTimer(const SteadyTimerEvent& event) {
    using namespace rtcf::ros1;
    using Retry = void (*)(TransportPublisherLink*, const SteadyTimerEvent&);
    static const auto retry = reinterpret_cast<Retry>(
        dlsym(RTLD_NEXT, "_ZN3ros22TransportPublisherLink12onRetryTimerERKNS_16SteadyTimerEventE"));
    if (retry == nullptr) return;
    const ConnectionPtr before = connection_;
    // A publisher that was killed stays in roscpp's list until the master forgets it.
    if (const SubscriptionPtr topic = parent_.lock();
        topic && before->isDropped() && topic->getNumPublishers() == 1) {
        if (const auto injector = injectorOf(topic->getName())) injector->setFed(false);
    }
    // roscpp's function doubles the pause before its attempt.
    if (soon) retry_period_ = std::min(retry_period_, WallDuration(kLongestPause / 2));
    retry(this, event);
    // roscpp does not repeat an attempt that fails at once, e.g. without a route.
    const bool gave_up = !dropping_ && !needs_retry_ && connection_ == before;
    if (soon && gave_up && connection_->isDropped()) {
        needs_retry_ = true;
        next_retry_ = SteadyTime::now() + retry_period_;
    }
}

}  // namespace ros

#include "ros/transport/bounded_transport.hpp"

#include <dlfcn.h>
#include <ros/connection.h>
#include <ros/publisher_link.h>
#include <ros/subscription.h>
#include <ros/transport/transport.h>
#include <ros/transport_publisher_link.h>
#include <ros/transport_subscriber_link.h>
#include <unistd.h>
#include <xmlrpcpp/XmlRpcSocket.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstring>
#include <map>
#include <mutex>

#include "ros/transport/idle_subscribers.hpp"
#include "ros/transport/raw_message.hpp"

namespace rtcf::ros1 {

namespace {

constexpr std::uint32_t kMega = 1024 * 1024;
// Limit for connections that this process has opened, also for components' own subscribers.
constexpr std::uint32_t kMostRead = 65 * kMega;
// Limit for connections that a peer has opened, to request a topic or to call a service.
constexpr std::uint32_t kMostReadOfServer = 8 * kMega;
constexpr std::uint32_t kMostHeader = kMega;
constexpr std::uint32_t kMostHeaderOfServer = 64 * 1024;
constexpr std::size_t kMostWaiting = 4 * kMega;  // bytes queued for one slow subscriber
// Limit of a call or an answer of XML-RPC; as a growing string, it takes several times as much
// memory.
constexpr std::size_t kMostXmlRpc = 4 * kMega;
constexpr std::uint32_t kSkippedAtOnce = 16 * 1024;

// Injectors by topic, as roscpp's links know only the topic.
struct Topics {
    std::mutex mutex;
    std::map<std::string, std::weak_ptr<executor::Injector>> injectors;
};

Topics& topics() {
    // NOLINT(cppcoreguidelines-owning-memory): for roscpp's threads
    static auto& all = *new Topics;
    return all;
}

// Allocates network memory; null if there is none left.
boost::shared_array<std::uint8_t> tryNetworkBytes(std::size_t bytes) {
    try {
        return networkBytes(bytes);
    } catch (const std::bad_alloc&) {
        return {};
    }
}

}  // namespace

void boundTopic(const std::string& topic, const std::shared_ptr<executor::Injector>& injector) {
    const std::lock_guard lock(topics().mutex);
    auto& injectors = topics().injectors;
    for (auto each = injectors.begin(); each != injectors.end();)
        each = each->second.expired() ? injectors.erase(each) : std::next(each);
    injectors[topic] = injector;
}

std::shared_ptr<executor::Injector> injectorOf(const std::string& topic) {
    const std::lock_guard lock(topics().mutex);
    const auto found = topics().injectors.find(topic);
    return found == topics().injectors.end() ? nullptr : found->second.lock();
}

}  // namespace rtcf::ros1

// The following functions replace those of roscpp and xmlrpcpp.

namespace ros {

void Connection::read(std::uint32_t size, const ReadFinishedFunc& callback) {
    if (dropped_ || sending_header_error_) return;
    const std::uint32_t most = is_server_ ? rtcf::ros1::kMostReadOfServer : rtcf::ros1::kMostRead;
    const auto buffer =
        size <= most ? rtcf::ros1::tryNetworkBytes(size) : boost::shared_array<std::uint8_t>();
    if (!buffer) {
        // A disconnect is retried, a header error is not.
        drop(size <= most ? TransportDisconnect : HeaderError);
        return;
    }
    {
        const boost::recursive_mutex::scoped_lock lock(read_mutex_);
        read_callback_ = callback;
        read_buffer_ = buffer;
        read_size_ = size;
        read_filled_ = 0;
        has_read_callback_ = 1;
    }
    transport_->enableRead();
    readTransport();  // reads data that has already arrived
}

void Connection::onHeaderLengthRead(const ConnectionPtr& /*self*/,
                                    const boost::shared_array<std::uint8_t>& buffer,
                                    std::uint32_t /*size*/, bool success) {
    if (!success) return;
    std::uint32_t length = 0;
    std::memcpy(&length, buffer.get(), sizeof length);
    if (length > (is_server_ ? rtcf::ros1::kMostHeaderOfServer : rtcf::ros1::kMostHeader)) {
        drop(HeaderError);
        return;
    }
    read(length, [this](const ConnectionPtr& connection,
                        const boost::shared_array<std::uint8_t>& header, std::uint32_t bytes,
                        bool read_all) { onHeaderRead(connection, header, bytes, read_all); });
}

void TransportPublisherLink::onMessageLength(const ConnectionPtr& connection,
                                             const boost::shared_array<std::uint8_t>& buffer,
                                             std::uint32_t size, bool success) {
    const auto read_length = [this] {
        connection_->read(
            4, [this](const ConnectionPtr& link, const boost::shared_array<std::uint8_t>& bytes,
                      std::uint32_t count,
                      bool read_all) { onMessageLength(link, bytes, count, read_all); });
    };
    // Reads and discards a message, piece by piece.
    struct Skip {
        TransportPublisherLink* link;
        decltype(read_length) then;
        std::uint32_t left;

        void operator()(const ConnectionPtr& /*connection*/,
                        const boost::shared_array<std::uint8_t>& /*bytes*/, std::uint32_t count,
                        bool read_all) {
            if (!read_all) return;
            left -= count;
            next();
        }
        void next() {
            if (left == 0) {
                then();
            } else {
                link->connection_->read(std::min(left, rtcf::ros1::kSkippedAtOnce), *this);
            }
        }
    };
    constexpr std::uint32_t kNoLength = 1'000'000'000;
    if (success && connection_) {
        std::uint32_t length = 0;
        std::memcpy(&length, buffer.get(), sizeof length);
        const SubscriptionPtr parent = parent_.lock();
        const std::shared_ptr<rtcf::executor::Injector> injector =
            parent ? rtcf::ros1::injectorOf(parent->getName()) : nullptr;
        const bool admitted = !injector || injector->admits(length);
        const bool room = length <= rtcf::ros1::kMostRead && rtcf::ros1::tryNetworkBytes(length);
        if (admitted && !room && injector) injector->refuse();
        // A length above roscpp's own limit is invalid; roscpp handles it.
        if (length <= kNoLength && !(admitted && room)) {
            Skip{this, read_length, length}.next();
            return;
        }
    }
    using Function = void (*)(TransportPublisherLink*, const ConnectionPtr&,
                              const boost::shared_array<std::uint8_t>&, std::uint32_t, bool);
    // roscpp's function does the rest. A member function is called as a function with `this` as
    // first argument.
    static const auto original = reinterpret_cast<Function>(dlsym(
        RTLD_NEXT,
        "_ZN3ros22TransportPublisherLink15onMessageLengthERKN5boost10shared_ptrINS_10ConnectionEEE"
        "RKNS1_12shared_arrayIhEEjb"));
    original(this, connection, buffer, size, success);
}

void TransportSubscriberLink::enqueueMessage(const SerializedMessage& message, bool serialized,
                                             bool no_copy) {
    // Gives access to the elements of a std::queue.
    struct Queue : std::queue<SerializedMessage> {
        static std::size_t bytes(const std::queue<SerializedMessage>& queue) {
            std::size_t sum = 0;
            for (const SerializedMessage& each : queue.*(&Queue::c)) sum += each.num_bytes;
            return sum;
        }
    };
    const auto oldest = [this]() -> const void* {
        return outbox_.empty() ? nullptr : outbox_.front().buf.get();
    };
    const bool scarce = rtcf::ros1::IdleSubscribers::scarce();
    const void* before = nullptr;
    {
        const boost::mutex::scoped_lock lock(outbox_mutex_);
        before = oldest();
        std::size_t bytes = outbox_.size() > 1 ? Queue::bytes(outbox_) : 0;
        while (outbox_.size() > 1 && bytes + message.num_bytes > rtcf::ros1::kMostWaiting) {
            bytes -= outbox_.front().num_bytes;
            outbox_.pop();  // drops the oldest, as roscpp does for too many messages
        }
    }
    using Function = void (*)(TransportSubscriberLink*, const SerializedMessage&, bool, bool);
    static const auto original = reinterpret_cast<Function>(dlsym(
        RTLD_NEXT, "_ZN3ros23TransportSubscriberLink14enqueueMessageERKNS_17SerializedMessageEbb"));
    original(this, message, serialized, no_copy);
    if (!scarce) return;
    const void* after = nullptr;
    {
        const boost::mutex::scoped_lock lock(outbox_mutex_);
        after = oldest();
    }
    rtcf::ros1::IdleSubscribers::ofProcess().note(shared_from_this(), before, after);
}

}  // namespace ros

namespace XmlRpc {

bool XmlRpcSocket::nbRead(int socket, std::string& text, bool* eof) {
    std::array<char, 4096> piece{};
    *eof = false;
    while (text.size() <= rtcf::ros1::kMostXmlRpc) {
        const ssize_t count = ::read(socket, piece.data(), piece.size());
        if (count > 0) {
            text.append(piece.data(), static_cast<std::size_t>(count));
        } else if (count == 0) {
            *eof = true;
            return true;
        } else if (errno == EAGAIN || errno == EINTR || errno == EINPROGRESS) {
            return true;
        } else {
            return false;
        }
    }
    return false;  // the caller closes the connection
}

}  // namespace XmlRpc

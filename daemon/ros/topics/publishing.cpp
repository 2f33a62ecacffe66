#include "ros/topics/publishing.hpp"

#include <chrono>
#include <iterator>
#include <limits>
#include <set>
#include <utility>

#include "ros/threads/quiet_thread.hpp"
#include "ros/transport/idle_subscribers.hpp"

namespace rtcf::ros1 {

namespace {

// Most messages per tap and turn, so that a fast tap does not starve others.
constexpr int kMostAtOnce = 1000;

}  // namespace

Publishing::Deliveries::Deliveries(const executor::BridgeSettings& settings)
    : queue_(settings.queue),
      latched_("latch", settings.latch),
      stamped_("stamped", settings.stamped) {}

Delivery Publishing::Deliveries::of(const std::string& topic) const {
    return {queue_, latched_.matches(topic), stamped_.matches(topic)};
}

Publishing::Key Publishing::keyOf(const executor::Tap& tap) {
    return {tap.topic(), tap.type().ros_type, tap.type().ros_md5};
}

Publishing::Publishing(std::function<void(const std::string&)> warn) : warn_(std::move(warn)) {
    thread_ = quietThread("ros-publish", [this] { run(); });
}

Publishing::~Publishing() {
    {
        const std::lock_guard lock(mutex_);
        stop_ = true;
    }
    changed_.notify_all();
    thread_.join();
}

void Publishing::configure(const executor::BridgeSettings& settings) {
    Deliveries deliveries(settings);
    {
        const std::lock_guard lock(mutex_);
        deliveries_ = std::move(deliveries);
        for (const auto& [key, publisher] : publishers_)
            publisher->setDelivery(deliveries_->of(std::get<0>(key)));
        makeReady();
    }
    changed_.notify_all();
}

void Publishing::setTaps(Taps taps) {
    {
        const std::lock_guard lock(mutex_);
        taps_ = std::move(taps);
        makeReady();
        ++generation_;
    }
    changed_.notify_all();
}

// Makes publishers for new taps at once, so that latched values are kept even before the watch
// thread opens the topics.
void Publishing::makeReady() {
    if (!deliveries_) return;
    for (const auto& tap : taps_) {
        std::shared_ptr<TopicPublisher>& publisher = publishers_[keyOf(*tap)];
        if (publisher != nullptr) continue;
        publisher = std::make_shared<TopicPublisher>(tap->topic(), tap->type(),
                                                     deliveries_->of(tap->topic()));
        ++generation_;
    }
}

Reconciled Publishing::reconcile(ros::NodeHandle& handle) {
    Publishers opening;
    Publishers closing;
    {
        const std::lock_guard lock(mutex_);
        std::set<Key> wanted;
        for (const auto& tap : taps_) {
            // Several outputs may write one topic.
            const Key key = keyOf(*tap);
            if (!wanted.insert(key).second) continue;
            const std::shared_ptr<TopicPublisher>& publisher = publishers_.at(key);
            const bool outdated = publisher->isOutdated();
            if (outdated) closing.push_back(publisher);
            if (outdated || publisher->isDue()) opening.push_back(publisher);
        }
        for (auto each = publishers_.begin(); each != publishers_.end();) {
            const bool stays = wanted.count(each->first) != 0;
            if (!stays) closing.push_back(each->second);
            each = stays ? std::next(each) : publishers_.erase(each);
        }
        if (opening.empty() && closing.empty()) return Reconciled::Done;
        ++generation_;
    }
    changed_.notify_all();
    // Without the lock, because opening and closing wait for peers and the master.
    close(closing);
    Reconciled result = Reconciled::Done;
    for (const auto& publisher : opening) {
        publisher->open(handle);
        if (!publisher->isOpen()) result = Reconciled::Later;
    }
    return result;
}

void Publishing::tidy() {
    const std::lock_guard lock(mutex_);
    std::set<Key> wanted;
    for (const auto& tap : taps_) wanted.insert(keyOf(*tap));
    for (auto each = publishers_.begin(); each != publishers_.end();) {
        const bool stays = wanted.count(each->first) != 0 || each->second->isOpen();
        each = stays ? std::next(each) : publishers_.erase(each);
    }
}

void Publishing::closeAll() {
    Publishers closing;
    {
        // The publishers stay, with the last messages of latched topics.
        const std::lock_guard lock(mutex_);
        for (const auto& [key, publisher] : publishers_) closing.push_back(publisher);
    }
    close(closing);
}

// Waits at most this long for slow subscribers; messages still queued are then lost.
void Publishing::close(const Publishers& closing) {
    constexpr auto kPatience = std::chrono::milliseconds(500);
    if (closing.empty()) return;
    const auto deadline = std::chrono::steady_clock::now() + kPatience;
    {
        std::unique_lock lock(mutex_);
        changed_.wait_until(lock, deadline,
                            [this, wanted = generation_] { return served_ >= wanted; });
    }
    for (const auto& publisher : closing) publisher->flush(deadline);
    for (const auto& publisher : closing) publisher->close();
}

std::uint32_t Publishing::open() const {
    const std::lock_guard lock(mutex_);
    std::uint32_t count = 0;
    for (const auto& [key, publisher] : publishers_) count += publisher->isOpen() ? 1 : 0;
    return count;
}

std::string Publishing::problem() const {
    const std::lock_guard lock(mutex_);
    for (const auto& [key, publisher] : publishers_) {
        if (!publisher->problem().empty()) return publisher->problem();
    }
    for (const auto& [key, publisher] : publishers_) {
        if (publisher->lost() != 0)
            return std::get<0>(key) +
                   ": messages were dropped, because too many wait for slow subscribers";
    }
    return {};
}

std::vector<Publishing::Stream> Publishing::streams() const {
    std::vector<Stream> streams;
    for (const auto& tap : taps_) {
        const auto found = publishers_.find(keyOf(*tap));
        if (found != publishers_.end()) streams.push_back({tap, found->second});
    }
    return streams;
}

void Publishing::drain(const Stream& stream, int most) {
    const auto use = [&stream](const std::uint8_t* bytes, std::uint32_t size,
                               std::int64_t stamp_ns) {
        stream.publisher->publish(bytes, size, stamp_ns);
    };
    for (int i = 0; i < most && stream.tap->pop(use); ++i) {
    }
}

// Publishes the last values of removed taps completely.
void Publishing::leave(const std::vector<Stream>& streams, const std::vector<Stream>& next) {
    std::set<const executor::Tap*> staying;
    for (const Stream& stream : next) staying.insert(stream.tap.get());
    for (const Stream& stream : streams) {
        const bool stays = staying.count(stream.tap.get()) != 0;
        drain(stream, stays ? kMostAtOnce : std::numeric_limits<int>::max());
    }
}

void Publishing::makeRoom() {
    constexpr auto kPeriod = std::chrono::milliseconds(100);
    constexpr auto kSilence = std::chrono::seconds(10);
    const auto now = std::chrono::steady_clock::now();
    if (now - room_looked_at_ < kPeriod) return;
    room_looked_at_ = now;
    disconnected_ += IdleSubscribers::ofProcess().disconnect();
    if (disconnected_ == 0 || now - room_told_ < kSilence) return;
    room_told_ = now;
    warn_(std::to_string(std::exchange(disconnected_, 0)) +
          " subscribers that read nothing were disconnected, because their messages used too much "
          "memory");
}

void Publishing::run() {
    constexpr auto kPeriod = std::chrono::milliseconds(1);
    std::vector<Stream> serving;
    std::uint64_t generation = 0;
    while (true) {
        {
            std::unique_lock lock(mutex_);
            // Without taps, the thread sleeps.
            while (!stop_ && serving.empty() && generation == generation_) changed_.wait(lock);
            if (stop_) return;
            if (generation != generation_) {
                generation = generation_;
                std::vector<Stream> next = streams();
                lock.unlock();
                leave(serving, next);
                serving = std::move(next);
                lock.lock();
                served_ = generation;
                lock.unlock();
                changed_.notify_all();
            }
        }
        for (const Stream& stream : serving) drain(stream, kMostAtOnce);
        makeRoom();
        std::this_thread::sleep_for(kPeriod);
    }
}

}  // namespace rtcf::ros1

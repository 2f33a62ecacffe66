#include "ros/topics/publishing.hpp"

#include <chrono>
#include <limits>
#include <set>
#include <utility>

#include "names/name_pattern.hpp"
#include "ros/threads/quiet_thread.hpp"
#include "ros/transport/idle_subscribers.hpp"

namespace rtcf::ros1 {

namespace {

constexpr int kMost = 1000;  // a tap that fills as fast as it is emptied starves no other

// What settings say of each topic.
class Deliveries {
   public:
    explicit Deliveries(const executor::BridgeSettings& settings)
        : queue_(settings.queue),
          latched_("latch", settings.latch),
          stamped_("stamped", settings.stamped) {}

    Delivery of(const std::string& topic) const {
        return {queue_, latched_.matches(topic), stamped_.matches(topic)};
    }

   private:
    std::uint32_t queue_;
    executor::NamePattern latched_;
    executor::NamePattern stamped_;
};

}  // namespace

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

void Publishing::setTaps(Taps taps) {
    {
        const std::lock_guard lock(mutex_);
        taps_ = std::move(taps);
        ++generation_;
    }
    changed_.notify_all();
}

void Publishing::prepare(const executor::BridgeSettings& settings) {
    const Deliveries deliveries(settings);
    const std::lock_guard lock(mutex_);
    bool any = false;
    for (const auto& tap : taps_) {
        std::shared_ptr<TopicPublisher>& publisher = publishers_[tap->topic()];
        if (publisher != nullptr) continue;
        publisher = std::make_shared<TopicPublisher>(tap->topic(), tap->type(),
                                                     deliveries.of(tap->topic()));
        any = true;
    }
    if (!any) return;
    ++generation_;
    changed_.notify_all();
}

Reconciled Publishing::reconcile(ros::NodeHandle& handle,
                                 const executor::BridgeSettings& settings) {
    const Deliveries deliveries(settings);
    Publishers opening;
    Publishers closing;
    {
        const std::lock_guard lock(mutex_);
        std::map<std::string, std::shared_ptr<TopicPublisher>> wanted;
        for (const auto& tap : taps_) {
            // Several outputs may write one topic.
            if (wanted.count(tap->topic()) != 0) continue;
            const Delivery delivery = deliveries.of(tap->topic());
            const auto found = publishers_.find(tap->topic());
            if (found != publishers_.end() && found->second->serves(tap->type()) &&
                found->second->delivery() == delivery) {
                wanted[tap->topic()] = found->second;
                if (found->second->isDue()) opening.push_back(found->second);
                continue;
            }
            auto publisher = std::make_shared<TopicPublisher>(tap->topic(), tap->type(), delivery);
            if (found != publishers_.end()) publisher->inherit(*found->second);
            wanted[tap->topic()] = publisher;
            opening.push_back(std::move(publisher));
        }
        for (const auto& [topic, publisher] : publishers_) {
            const auto found = wanted.find(topic);
            if (found == wanted.end() || found->second != publisher) closing.push_back(publisher);
        }
        if (opening.empty() && closing.empty()) return Reconciled::Done;
        publishers_ = std::move(wanted);
        ++generation_;
    }
    changed_.notify_all();
    // Without the lock: peers come and go. A topic that changes its type closes first.
    close(closing);
    Reconciled result = Reconciled::Done;
    for (const auto& publisher : opening) {
        publisher->open(handle);
        if (!publisher->isOpen()) result = Reconciled::Later;
    }
    return result;
}

void Publishing::closeAll() {
    Publishers closing;
    {
        // They stay, with the last messages of those that are latched.
        const std::lock_guard lock(mutex_);
        for (const auto& [topic, publisher] : publishers_) closing.push_back(publisher);
    }
    close(closing);
}

// A subscriber that takes nothing holds up no more than this: what waits for it is lost.
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
    for (const auto& [topic, publisher] : publishers_) count += publisher->isOpen() ? 1 : 0;
    return count;
}

std::string Publishing::problem() const {
    const std::lock_guard lock(mutex_);
    for (const auto& [topic, publisher] : publishers_) {
        if (!publisher->problem().empty()) return publisher->problem();
    }
    for (const auto& [topic, publisher] : publishers_) {
        if (publisher->lost() != 0)
            return topic + ": messages were lost, as too much waits for slow subscribers";
    }
    return {};
}

std::vector<Publishing::Stream> Publishing::streams() const {
    std::vector<Stream> streams;
    for (const auto& tap : taps_) {
        const auto found = publishers_.find(tap->topic());
        // Until reconcile() replaces it, a publisher of another type must not get the bytes.
        const bool fits = found != publishers_.end() && found->second->serves(tap->type());
        streams.push_back({tap, fits ? found->second : nullptr});
    }
    return streams;
}

void Publishing::drain(const Stream& stream, int most) {
    const auto use = [&stream](const std::uint8_t* bytes, std::uint32_t size,
                               std::int64_t stamp_ns) {
        if (stream.publisher) stream.publisher->publish(bytes, size, stamp_ns);
    };
    for (int i = 0; i < most && stream.tap->pop(use); ++i) {
    }
}

// The last values of taps that leave: nobody fills them any more.
void Publishing::leave(const std::vector<Stream>& streams, const std::vector<Stream>& next) {
    std::set<const executor::Tap*> staying;
    for (const Stream& stream : next) staying.insert(stream.tap.get());
    for (const Stream& stream : streams) {
        const bool stays = staying.count(stream.tap.get()) != 0;
        drain(stream, stays ? kMost : std::numeric_limits<int>::max());
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
          " subscribers that took nothing were disconnected, as too much memory waited for them");
}

void Publishing::run() {
    constexpr auto kPeriod = std::chrono::milliseconds(1);
    std::vector<Stream> serving;
    std::uint64_t generation = 0;
    while (true) {
        {
            std::unique_lock lock(mutex_);
            // Nothing to empty: no need to wake up a thousand times a second.
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
        for (const Stream& stream : serving) drain(stream, kMost);
        makeRoom();
        std::this_thread::sleep_for(kPeriod);
    }
}

}  // namespace rtcf::ros1

/// @file
/// A tap passes the values of an output to one thread outside the loop, as serialised messages.
#pragma once

#include <atomic>
#include <cstdint>
#include <functional>
#include <memory>
#include <string>

#include "rtcf/port_type.hpp"
#include "rtcf/slot.hpp"

namespace rtcf::executor {

class Tap {
   public:
    /// Receives a message, which is valid during the call. The stamp is the ROS time of the cycle
    /// that wrote the value, ns.
    using Use =
        std::function<void(const std::uint8_t* bytes, std::uint32_t size, std::int64_t stamp_ns)>;

    virtual ~Tap() = default;
    Tap(const Tap&) = delete;
    Tap& operator=(const Tap&) = delete;

    /// The mapped name of the connection.
    const std::string& topic() const noexcept { return topic_; }
    /// The type of the output.
    const TypeInfo& type() const noexcept { return type_; }
    const SlotHeader* source() const noexcept { return source_.get(); }

    /// Takes every n-th written value from now on. Any thread.
    void setDecimation(std::uint32_t every) noexcept {
        decimation_.store(every, std::memory_order_relaxed);
    }
    /// Passes the oldest message to `use` and removes it. A value whose message cannot be built is
    /// removed without a call. Of two concurrent calls, one returns false. Not real-time safe.
    /// @return false if there is no value
    virtual bool pop(const Use& use) = 0;
    /// Number of values that were lost, because the reader was late or their conversion threw; at
    /// most, if they were lost with frames. Any thread.
    virtual std::uint64_t dropped() const noexcept = 0;
    /// Number of values that were lost because their messages were too large. Any thread.
    virtual std::uint64_t tooLarge() const noexcept = 0;

   protected:
    Tap(std::string topic, const TypeInfo& type, std::shared_ptr<const SlotHeader> source)
        : topic_(std::move(topic)), type_(type), source_(std::move(source)) {}
    std::uint32_t decimation() const noexcept RTCF_NONBLOCKING {
        return decimation_.load(std::memory_order_relaxed);
    }

   private:
    std::string topic_;
    const TypeInfo& type_;
    std::shared_ptr<const SlotHeader> source_;
    std::atomic<std::uint32_t> decimation_{1};
};

}  // namespace rtcf::executor

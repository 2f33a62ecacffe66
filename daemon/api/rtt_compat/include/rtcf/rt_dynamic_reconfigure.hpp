/// @file
/// RTCF 2021's way to tune a component by a .cfg file: a dynamic_reconfigure
/// server whose values reach the loop without a lock. A parameter that is
/// declared as rtcf::Parameter needs neither a .cfg file nor this.
#pragma once

#include <dynamic_reconfigure/server.h>
#include <ros/node_handle.h>

#include <array>
#include <atomic>
#include <cstdint>
#include <memory>

#include "rtcf/realtime.hpp"

/// @tparam T what the component needs of a configuration: it names the type that the .cfg file
/// generates as `ConfigType`, is made from one by a constructor, and copied without allocation.
template <class T>
class RTDynamicReconfigure {
   public:
    using ConfigType = typename T::ConfigType;

    /// Holds the .cfg file's defaults.
    RTDynamicReconfigure() : RTDynamicReconfigure(T(ConfigType::__getDefault__())) {}
    RTDynamicReconfigure(const RTDynamicReconfigure&) = delete;
    RTDynamicReconfigure& operator=(const RTDynamicReconfigure&) = delete;

    /// Opens the server in a handle's namespace, mostly the private one's; values that are on the
    /// parameter server already are there when it returns. In configureHook(); not real-time safe.
    void configure(const ros::NodeHandle& handle) {
        server_ = std::make_unique<dynamic_reconfigure::Server<ConfigType>>(handle);
        server_->setCallback(
            [this](ConfigType& config, std::uint32_t /*level*/) { offer(T(config)); });
    }

    /// Copies the newest values. One thread at a time; real-time safe.
    void getValue(T& data) RTCF_NONBLOCKING {
        if (isNewDataAvailable())
            front_ = middle_.exchange(front_, std::memory_order_acq_rel) & ~kFresh;
        data = values_[front_];
    }

    /// True if there are values that getValue() has not given yet. Real-time safe.
    bool isNewDataAvailable() const noexcept RTCF_NONBLOCKING {
        return (middle_.load(std::memory_order_relaxed) & kFresh) != 0;
    }

   private:
    static constexpr std::uint32_t kFresh = 4;  // set in middle_ beside an index 0 to 2

    explicit RTDynamicReconfigure(const T& defaults) : values_{defaults, defaults, defaults} {}

    // By the server, which calls one at a time.
    void offer(const T& value) {
        values_[back_] = value;
        back_ = middle_.exchange(back_ | kFresh, std::memory_order_acq_rel) & ~kFresh;
    }

    // A triple buffer: one is read, one is written, one waits between them.
    std::array<T, 3> values_;
    std::uint32_t front_ = 0;  // the loop's
    std::atomic<std::uint32_t> middle_{1};
    std::uint32_t back_ = 2;  // the server's
    // Last, so that it ends first.
    std::unique_ptr<dynamic_reconfigure::Server<ConfigType>> server_;
};

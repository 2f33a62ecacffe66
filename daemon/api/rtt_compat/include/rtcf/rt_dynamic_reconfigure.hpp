/// @file
/// RTCF 2021's class for tuning a component by a .cfg file: a dynamic_reconfigure server whose
/// values reach the loop without a lock. Parameters declared as rtcf::Parameter need neither a .cfg
/// file nor this class.
#pragma once

#include <dynamic_reconfigure/server.h>
#include <ros/node_handle.h>

#include <array>
#include <atomic>
#include <cstdint>
#include <memory>

#include "rtcf/realtime.hpp"

/// @tparam T the component's view of a configuration. It names the type generated from the .cfg
/// file as `ConfigType`, has a constructor from it, and can be copied without allocation.
template <class T>
class RTDynamicReconfigure {
   public:
    using ConfigType = typename T::ConfigType;

    /// Starts with the defaults of the .cfg file.
    RTDynamicReconfigure() : RTDynamicReconfigure(T(ConfigType::__getDefault__())) {}
    RTDynamicReconfigure(const RTDynamicReconfigure&) = delete;
    RTDynamicReconfigure& operator=(const RTDynamicReconfigure&) = delete;

    /// Opens the server in the handle's namespace, usually that of the private node handle. Values
    /// on the parameter server are loaded when the function returns. In configureHook(); not
    /// real-time safe.
    void configure(const ros::NodeHandle& handle) {
        server_ = std::make_unique<dynamic_reconfigure::Server<ConfigType>>(handle);
        server_->setCallback(
            [this](ConfigType& config, std::uint32_t /*level*/) { offer(T(config)); });
    }

    /// Copies the newest values. One thread at a time; real-time safe if the assignment of T is.
    void getValue(T& data) RTCF_NONBLOCKING {
        if (isNewDataAvailable())
            front_ = middle_.exchange(front_, std::memory_order_acq_rel) & ~kFresh;
        data = values_[front_];
    }

    /// True if there are values that getValue() has not returned yet. Real-time safe.
    bool isNewDataAvailable() const noexcept RTCF_NONBLOCKING {
        return (middle_.load(std::memory_order_relaxed) & kFresh) != 0;
    }

   private:
    static constexpr std::uint32_t kFresh = 4;  // set in middle_ beside an index 0 to 2

    explicit RTDynamicReconfigure(const T& defaults) : values_{defaults, defaults, defaults} {}

    // Called by the server, never concurrently.
    void offer(const T& value) {
        values_[back_] = value;
        back_ = middle_.exchange(back_ | kFresh, std::memory_order_acq_rel) & ~kFresh;
    }

    // Triple buffer: one value is read, one is written, one waits in between.
    std::array<T, 3> values_;
    std::uint32_t front_ = 0;  // owned by the loop
    std::atomic<std::uint32_t> middle_{1};
    std::uint32_t back_ = 2;  // owned by the server
    // Last member, so that it is destroyed first.
    std::unique_ptr<dynamic_reconfigure::Server<ConfigType>> server_;
};

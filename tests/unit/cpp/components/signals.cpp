// Small components whose outputs show their inputs.
#include <std_msgs/Float64.h>
#include <std_msgs/Int32.h>
#include <std_msgs/String.h>

#include <Eigen/Core>
#include <memory>
#include <rtcf/component.hpp>
#include <rtcf/eigen_type.hpp>
#include <string>

namespace {

// Outputs its input plus `add`, new or old, and the status of its read.
class Relay final : public rtcf::Component {
    rtcf::Input<std_msgs::Float64> in{this, "in"};
    rtcf::Output<std_msgs::Float64> out{this, "out"};
    rtcf::Output<std::int32_t> status{this, "status"};
    rtcf::Parameter<double> add{this, "add", 1.0};

    void update() override {
        status.write(static_cast<std::int32_t>(in.read()));
        out.value().data = in.value().data + add;
        out.publish();
    }
};

// Writes its iteration in every `every`-th cycle only.
class Ticker final : public rtcf::Component {
    rtcf::Output<std_msgs::Float64> out{this, "out"};
    rtcf::Parameter<std::int64_t> every{this, "every", 1, rtcf::Min(1)};

    void update() override {
        if (iteration() % static_cast<std::uint64_t>(every.value()) != 0) return;
        out.value().data = static_cast<double>(iteration());
        out.publish();
    }
};

// Runs for `busy_us` in some updates, and sums elapsed(), in periods.
class Spinner final : public rtcf::Component {
    rtcf::Output<std_msgs::Float64> periods{this, "periods"};
    rtcf::Parameter<std::int64_t> busy_us{this, "busy_us", 0, rtcf::Min(0)};
    rtcf::Parameter<std::int64_t> busy_cycles{this, "busy_cycles", 1, rtcf::Min(0)};

    void update() override {
        periods.value().data += static_cast<double>(elapsed()) / static_cast<double>(period());
        periods.publish();
        if (iteration() < 20 || iteration() >= 20 + static_cast<std::uint64_t>(busy_cycles.value()))
            return;
        timespec now{};
        clock_gettime(CLOCK_MONOTONIC, &now);
        const std::int64_t until = nanoseconds(now) + busy_us * 1000;
        while (nanoseconds(now) < until) clock_gettime(CLOCK_MONOTONIC, &now);
    }

    static std::int64_t nanoseconds(const timespec& time) {
        return std::int64_t{time.tv_sec} * 1'000'000'000 + time.tv_nsec;
    }
};

// Writes texts that grow by a letter per cycle.
class Talker final : public rtcf::Component {
    rtcf::Output<std_msgs::String> out{this, "out"};

    bool configure() override {
        std_msgs::String longest;
        longest.data.assign(kLongest, 'a');
        out.reserve(longest);
        return true;
    }

    void update() override {
        out.value().data.resize(iteration() % kLongest);
        out.publish();
    }

    static constexpr std::size_t kLongest = 100;
};

// A port whose type differs from others of the same name.
class VectorSource final : public rtcf::Component {
    rtcf::Output<Eigen::Vector3d> out{this, "out"};
    void update() override { out.write(Eigen::Vector3d::Ones()); }
};

// Writes in the hooks before the first cycle, and modifies a value from configure() in place.
class Herald final : public rtcf::Component {
    rtcf::Output<std_msgs::Float64> announced{this, "announced"};
    rtcf::Output<std_msgs::Float64> counted{this, "counted"};

    bool configure() override {
        count_ = &counted.value().data;
        announced.value().data = 3.0;
        announced.publish();
        return true;
    }
    bool start() override {
        announced.value().data = 7.0;
        announced.publish();
        return true;
    }
    void update() override {
        *count_ += 1.0;
        counted.publish();
    }
    double* count_ = nullptr;
};

// Logs in every hook.
class Chatter final : public rtcf::Component {
    rtcf::Parameter<bool> refuses{this, "refuses", false};

    bool configure() override {
        RTCF_INFO(this, "configure at {}", time());
        return refuses ? fail("set to refuse") : true;
    }
    bool start() override {
        RTCF_INFO(this, "start in iteration {}", iteration());
        return true;
    }
    void update() override {
        RTCF_INFO_THROTTLE(this, 0.01, "update {} of {}", iteration(), name());
    }
    void safe() noexcept override { RTCF_WARN(this, "safe"); }
    void stop() override { RTCF_INFO(this, "stop"); }
    void cleanup() override { RTCF_INFO(this, "cleanup"); }
};

// Breaks the rules of the cycle.
class Allocator final : public rtcf::Component {
    void update() override { kept_ = std::make_unique<std::string>(100, 'x'); }
    std::unique_ptr<std::string> kept_;
};

}  // namespace

RTCF_COMPONENT(Relay, "Adds to its input")
RTCF_COMPONENT(Ticker, "Writes in each n-th cycle")
RTCF_COMPONENT(Spinner, "Takes time")
RTCF_COMPONENT(Talker, "Writes values of variable size")
RTCF_COMPONENT(VectorSource, "Writes an Eigen vector")
RTCF_COMPONENT(Herald, "Writes before the first cycle")
RTCF_COMPONENT(Chatter, "Logs in every hook")
RTCF_COMPONENT(Allocator, "Allocates in update()")

// Components that do in the loop what must not be done there, but leave their
// process alive.
#include <chrono>
#include <limits>
#include <memory>
#include <stdexcept>
#include <thread>
#include <vector>

#include "faulty.hpp"

namespace {

class Throws final : public Faulty {
    void fault() override { throw std::runtime_error("the encoder jumped"); }
    void safe() noexcept override { RTCF_INFO(this, "hook {} of what threw", "safe"); }
};

class Allocates final : public Faulty {
    static constexpr std::size_t kBytes = 10 * 1000 * 1000;
    void fault() override { std::vector<char>(kBytes, 1).swap(memory_); }
    std::vector<char> memory_;
};

class Hoards final : public Faulty {
    static constexpr std::size_t kBytes = 1000 * 1000;
    void fault() override { memory_.emplace_back(kBytes, 1); }
    std::vector<std::vector<char>> memory_;
};

class Sleeps final : public Faulty {
    void fault() override { std::this_thread::sleep_for(std::chrono::microseconds(100)); }
};

// Not so long that it would be a fault.
class Lingers final : public Faulty {
    void fault() override {
        const auto until = std::chrono::steady_clock::now() + std::chrono::milliseconds(150);
        while (std::chrono::steady_clock::now() < until) {
        }
    }
};

class NotFinite final : public Faulty {
    void fault() override { value_.write(std::numeric_limits<double>::quiet_NaN()); }
    rtcf::Output<double> value_{this, "value", "", rtcf::Finite()};
};

class WritesNan final : public Faulty {
    void fault() override { value_.write(std::numeric_limits<double>::quiet_NaN()); }
    rtcf::Output<double> value_{this, "value"};
};

class NotFiniteStops final : public Faulty {
    void fault() override { value_.write(std::numeric_limits<double>::infinity()); }
    void safe() noexcept override { RTCF_INFO(this, "hook {}", "safe"); }
    rtcf::Output<double> value_{this, "value", "", rtcf::Finite(rtcf::OnNonFinite::Stop)};
};

}  // namespace

RTCF_COMPONENT(Throws, "Throws an exception")
RTCF_COMPONENT(Allocates, "Allocates 10 MB in each update")
RTCF_COMPONENT(Hoards, "Takes 1 MB more in each update, until there is no memory left")
RTCF_COMPONENT(Sleeps, "Sleeps in each update")
RTCF_COMPONENT(Lingers, "Takes 150 ms in each update")
RTCF_COMPONENT(NotFinite, "Writes NaN to an output that is declared finite")
RTCF_COMPONENT(WritesNan, "Writes NaN to an output that is not declared finite")
RTCF_COMPONENT(NotFiniteStops, "Writes infinity to an output that stops the loop then")

// Components that do forbidden things in the loop, but leave their process
// alive.
#include <sys/mman.h>

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

// Too short for a fault.
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

class Reports final : public Faulty {
    void fault() override { reportFault("the sensor is dead"); }
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

// Is late once for each new value of `turn`, in the way selected by the other parameters.
class Stumbles final : public rtcf::Component {
   public:
    ~Stumbles() override {
        if (memory_ != nullptr) ::munmap(memory_, kSize);
    }

    // Evicts the pages from memory that are to be faulted in.
    bool prepare(const rtcf::Values& proposed) override {
        if (memory_ == nullptr && !map()) return fail("no memory to stumble over");
        if (proposed[pages_] > 0) {
            ::munlock(memory_, kSize);
            ::madvise(memory_, kSize, MADV_DONTNEED);
        }
        return true;
    }

    void update() override {
        if (turn_ == done_) return;
        done_ = turn_;
        for (std::int32_t page = 0; page < pages_; ++page) memory_[page * kPage] = 1;
        if (sleep_us_ > 0) std::this_thread::sleep_for(std::chrono::microseconds(sleep_us_));
        const auto until = std::chrono::steady_clock::now() + std::chrono::microseconds(spin_us_);
        while (std::chrono::steady_clock::now() < until) {
        }
    }

   private:
    static constexpr std::int32_t kPage = 4096;
    static constexpr std::int32_t kMostPages = 4096;
    static constexpr std::size_t kSize = std::size_t{kMostPages} * kPage;

    bool map() {
        void* const memory =
            ::mmap(nullptr, kSize, PROT_READ | PROT_WRITE, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0);
        if (memory == MAP_FAILED) return false;
        memory_ = static_cast<char*>(memory);
        ::madvise(memory, kSize, MADV_NOHUGEPAGE);
        return true;
    }

    rtcf::Parameter<std::int32_t> turn_{this, "turn", 0};
    rtcf::Parameter<std::int32_t> spin_us_{this, "spin_us", 0, rtcf::Min(0), rtcf::Max(100'000)};
    rtcf::Parameter<std::int32_t> sleep_us_{this, "sleep_us", 0, rtcf::Min(0), rtcf::Max(100'000)};
    rtcf::Parameter<std::int32_t> pages_{this, "pages", 0, rtcf::Min(0), rtcf::Max(kMostPages)};
    std::int32_t done_ = 0;
    char* memory_ = nullptr;
};

}  // namespace

RTCF_COMPONENT(Stumbles, "Is late once for each new value of a parameter")
RTCF_COMPONENT(Throws, "Throws an exception")
RTCF_COMPONENT(Allocates, "Allocates 10 MB in each update")
RTCF_COMPONENT(Hoards, "Allocates 1 MB more in each update, until memory is exhausted")
RTCF_COMPONENT(Sleeps, "Sleeps in each update")
RTCF_COMPONENT(Lingers, "Takes 150 ms in each update")
RTCF_COMPONENT(NotFinite, "Writes NaN to an output that is declared finite")
RTCF_COMPONENT(Reports, "Reports a fault that does not end the loop")
RTCF_COMPONENT(WritesNan, "Writes NaN to an output that is not declared finite")
RTCF_COMPONENT(NotFiniteStops, "Writes infinity to an output that stops the loop then")

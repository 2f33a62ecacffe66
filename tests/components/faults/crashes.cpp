// Components that end their process, each in a different way.
#include <time.h>

#include <array>
#include <cstdint>
#include <cstdlib>
#include <stdexcept>

#include "faulty.hpp"

namespace {

// Through volatile, since the compiler would otherwise foresee the fault and generate
// different code.
volatile int zero = 0;  // NOLINT(cppcoreguidelines-avoid-non-const-global-variables)

class NullDereference final : public Faulty {
    void fault() override {
        volatile int* volatile nowhere = nullptr;
        *nowhere = 1;
    }
};

class DivisionByZero final : public Faulty {
    void fault() override { zero = 7 / zero; }
};

class StackOverflow final : public Faulty {
    static int deeper(const volatile char* above) {
        std::array<volatile char, 4096> frame{};
        frame[0] = *above;
        return deeper(frame.data()) + frame[0];
    }
    void fault() override {
        volatile char bottom = 1;
        zero = deeper(&bottom);
    }
};

class HeapCorruption final : public Faulty {
    void fault() override {
        // Overwrites the allocator's data around a block, so that freeing it fails.
        auto* block = static_cast<volatile char*>(std::malloc(24));
        for (int i = -8; i < 64; ++i) block[i] = 0x5a;
        std::free(const_cast<char*>(block));  // NOLINT(cppcoreguidelines-pro-type-const-cast)
    }
};

class CallsAbort final : public Faulty {
    void fault() override { std::abort(); }
};

class CallsExit final : public Faulty {
    // NOLINTNEXTLINE(concurrency-mt-unsafe): this is the fault under test
    void fault() override { std::exit(3); }
};

class NeverReturns final : public Faulty {
    void fault() override {
        while (zero == 0) {
        }
    }
};

class ThrowsThroughNoexcept final : public Faulty {
    [[gnu::noinline]] static void raise() {
        if (zero == 0) throw std::runtime_error("nobody can catch this");
    }
    void fault() noexcept override { raise(); }
};

[[noreturn]] void hang() {
    while (zero == 0) {
    }
    std::abort();
}

class HangsInSafe final : public rtcf::Component {
    void update() override {}
    void safe() noexcept override { hang(); }
};

class HangsInTakeOver final : public rtcf::Component {
    void update() override {}
    void takeOver(const rtcf::Predecessor& /*previous*/) noexcept override { hang(); }
};

class HangsInWait final : public rtcf::Source {
    void update() override { ++updates_; }
    bool wait(std::int64_t /*deadline_ns*/) noexcept override {
        if (updates_ > kCycles) hang();
        return true;
    }
    static constexpr int kCycles = 20;
    int updates_ = 0;
};

// Never sleeps, like polling drivers.
class PollsSilence final : public rtcf::Source {
    void update() override {}
    bool wait(std::int64_t deadline_ns) noexcept override {
        timespec now{};
        do {
            clock_gettime(CLOCK_MONOTONIC, &now);
        } while (std::int64_t{now.tv_sec} * 1'000'000'000 + now.tv_nsec < deadline_ns);
        return false;
    }
};

class CrashesInSafe final : public rtcf::Component {
    void update() override {}
    void safe() noexcept override { std::abort(); }
};

class CrashesInTakeOver final : public rtcf::Component {
    void update() override {}
    void takeOver(const rtcf::Predecessor& /*previous*/) noexcept override { std::abort(); }
};

class CrashesInWait final : public rtcf::Source {
    void update() override { ++updates_; }
    bool wait(std::int64_t /*deadline_ns*/) noexcept override {
        if (updates_ > kCycles) std::abort();
        return true;
    }
    static constexpr int kCycles = 20;
    int updates_ = 0;
};

class CrashingConfigure final : public rtcf::Component {
    bool configure() override {
        volatile int* volatile nowhere = nullptr;
        *nowhere = 1;
        return true;
    }
    void update() override {}
};

class CrashingStop final : public rtcf::Component {
    void stop() override {
        volatile int* volatile nowhere = nullptr;
        *nowhere = 1;
    }
    void update() override {}
};

}  // namespace

RTCF_COMPONENT(NullDereference, "Writes through a null pointer")
RTCF_COMPONENT(DivisionByZero, "Divides an integer by zero")
RTCF_COMPONENT(StackOverflow, "Recurses endlessly")
RTCF_COMPONENT(HeapCorruption, "Writes behind a block of the heap")
RTCF_COMPONENT(CallsAbort, "Calls abort()")
RTCF_COMPONENT(CallsExit, "Calls exit(3)")
RTCF_COMPONENT(NeverReturns, "Does not return from update()")
RTCF_COMPONENT(ThrowsThroughNoexcept, "Throws in a noexcept function")
RTCF_COMPONENT(HangsInSafe, "Does not return from safe()")
RTCF_COMPONENT(HangsInTakeOver, "Does not return from takeOver()")
RTCF_COMPONENT(HangsInWait, "Does not return from wait()")
RTCF_COMPONENT(PollsSilence, "Polls a device that is never ready")
RTCF_COMPONENT(CrashesInSafe, "Aborts in safe()")
RTCF_COMPONENT(CrashesInTakeOver, "Aborts in takeOver()")
RTCF_COMPONENT(CrashesInWait, "Aborts in wait()")
RTCF_COMPONENT(CrashingConfigure, "Crashes in configure()")
RTCF_COMPONENT(CrashingStop, "Crashes in stop()")

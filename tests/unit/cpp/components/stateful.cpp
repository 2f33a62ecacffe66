// Built twice, with different VERSIONs: a class before and after a change of its members. An object
// of one must not be read as one of the other.
#include <array>
#include <rtcf/component.hpp>

namespace {

struct Delay {
    double now = 0.0;
    double before = 0.0;
    template <typename Visit>
    void fields(Visit&& visit) {
        visit("now", now);
        visit("before", before);
    }
};

class Stateful final : public rtcf::Component {
#if VERSION == 2
    std::array<double, 9> added_{};  // moves all following members
    rtcf::State<double> fresh{this, "fresh", 0.25};
    rtcf::State<double> renamed{this, "new_name", 0.0};
    rtcf::State<double> gain{this, "gain", 2.0};
#else
    rtcf::State<float> gain{this, "gain", 1.0F};
    rtcf::State<double> renamed{this, "old_name", 7.5};
    rtcf::State<bool> dropped{this, "dropped", true};
#endif
    rtcf::State<std::uint64_t> count{this, "count", 0, rtcf::Doc("updates so far")};
    rtcf::State<Delay> delay{this, "delay", {}, rtcf::Unit("cycles")};
    rtcf::Output<double> out{this, "out"};
    rtcf::Output<double> skipped{this, "skipped"};  // cycles skipped between two updates

    void update() override {
        ++count;
        delay->before = delay->now;
        delay->now = static_cast<double>(iteration());
        out.write(static_cast<double>(count));
        skipped.write(count == 1 ? 0.0 : delay->now - delay->before - 1.0);
    }

#if VERSION == 2
    void takeOver(const rtcf::Predecessor& previous) noexcept override {
        if (const auto* old = previous.state<double>("old_name")) renamed = *old;
        if (previous.state<double>("count") != nullptr || previous.state<int>("none") != nullptr)
            renamed = -1.0;  // of another type, and missing
        if (const auto* last = previous.output<double>("out")) fresh = *last;
    }
#endif
};

}  // namespace

RTCF_COMPONENT(Stateful, "Counts, with more or fewer members")

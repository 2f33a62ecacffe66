// Mixes its inputs, in integers, so that a model of the graph can compute each value
// exactly. Each of its hooks can fail on demand.
#include <cstdint>
#include <string>

#include <rtcf/component.hpp>

namespace {

class Mixer final : public rtcf::Component {
    rtcf::Input<std::int32_t> in1{this, "in1"};
    rtcf::Input<std::int32_t> in2{this, "in2"};
    rtcf::Input<double> level{this, "level"};
    rtcf::Output<std::int32_t> out{this, "out"};
    rtcf::Output<double> half{this, "half"};
    rtcf::Output<std::int32_t> updates{this, "updates"};

    rtcf::Parameter<std::int32_t> offset{this, "offset", 1, rtcf::Min(-100), rtcf::Max(100)};
    rtcf::Parameter<std::int32_t> gain{this, "gain", 1, rtcf::Min(0), rtcf::Max(9)};
    rtcf::Parameter<std::string> unwilling{this, "unwilling", "",
                                           rtcf::Doc("configure or start, which then refuses")};
    // Derived from the parameters in prepare(); changes in the same cycle as they do.
    rtcf::Derived<std::int64_t> product{this};
    rtcf::State<std::int32_t> updates_{this, "updates", 0};

    bool prepare(const rtcf::Values& proposed) override {
        if (proposed[offset] == kUnlucky) return fail("{} is an unlucky offset", kUnlucky);
        product.stage(std::int64_t{proposed[offset]} * proposed[gain]);
        return true;
    }
    bool configure() override {
        return unwilling.value() != "configure" || fail("set to fail in configure");
    }
    bool start() override { return unwilling.value() != "start" || fail("set to fail in start"); }

    void update() override {
        in1.read();
        in2.read();
        level.read();
        std::int64_t sum = std::int64_t{offset.value()} * gain.value();
        if (sum != *product) sum = kTorn;
        sum += 3 * std::int64_t{in1.value()} + 5 * std::int64_t{in2.value()} +
               static_cast<std::int64_t>(level.value());
        const auto mixed = static_cast<std::int32_t>(((sum % kModulus) + kModulus) % kModulus);
        out.write(mixed);
        half.write(mixed / 2.0);
        updates.write(++updates_);
    }

    static constexpr std::int32_t kUnlucky = 13;
    static constexpr std::int64_t kModulus = 100'003;
    static constexpr std::int64_t kTorn = 50'000;  // never expected by the model
};

}  // namespace

RTCF_COMPONENT(Mixer, "Mixes its inputs")

// A controller and a driver that show their actions in the last cycle.
#include <std_msgs/String.h>

#include <array>
#include <cmath>
#include <cstdint>
#include <limits>
#include <rtcf/component.hpp>
#include <stdexcept>
#include <string>

#include "journal.hpp"

namespace {

void note(const rtcf::Component& component, const char* what) {
    if (rtcf_unit_test_journal != nullptr)
        rtcf_unit_test_journal()->note(component.fullName(), what);
}

// Commands 5, and 0 in safe(). May leave an incomplete command when it throws.
class Controller final : public rtcf::Component {
    rtcf::Output<double> effort{this, "effort"};
    rtcf::Output<double> other{this, "other"};
    rtcf::Output<double> checked{this, "checked", "", rtcf::Finite()};
    rtcf::Output<double> vital{this, "vital", "", rtcf::Finite(rtcf::OnNonFinite::Stop)};
    rtcf::Parameter<bool> silent{this, "silent", false, rtcf::Doc("writes nothing in update()")};
    rtcf::Parameter<bool> wild{this, "wild", false, rtcf::Doc("makes safe by NaN")};
    rtcf::Parameter<std::int64_t> nan_from{this, "nan_from", -1, rtcf::Doc("update that begins")};
    rtcf::Parameter<std::int64_t> throws_at{this, "throws_at", -1};
    rtcf::Parameter<bool> keeps{this, "keeps", false, rtcf::Doc("writes nothing in safe()")};
    std::int64_t count_ = 0;

    void update() override {
        const std::int64_t count = count_++;
        if (silent) return;
        if (count == throws_at) {
            other.write(666.0);
            effort.value() = 666.0;
            checked.write(666.0);
            throw std::runtime_error("as told");
        }
        effort.write(5.0);
        other.write(5.0);
        vital.write(5.0);
        const bool nan = nan_from >= 0 && count >= nan_from;
        checked.write(nan ? std::numeric_limits<double>::quiet_NaN() : 5.0);
    }
    void safe() noexcept override {
        note(*this, "safe");
        if (keeps) return;
        effort.write(0.0);
        other.write(0.0);
        const double zero = wild ? std::numeric_limits<double>::quiet_NaN() : 0.0;
        checked.write(zero);
        vital.write(zero);
    }
    void takeOver(const rtcf::Predecessor& /*previous*/) noexcept override {
        note(*this, "takeOver");
    }
};

// Applies commands; counts new ones, and records the kind of cycle of each.
class Driver final : public rtcf::Component {
    rtcf::Input<double> command{this, "command"};
    rtcf::Output<double> applied{this, "applied", "", rtcf::Finite()};
    rtcf::Output<double> held{this, "held"};
    rtcf::Output<double> lowest{this, "lowest"};
    rtcf::Output<std::int32_t> last_status{this, "last_status"};
    rtcf::Output<std::int32_t> zeros{this, "zeros"};
    rtcf::Output<double> periods{this, "periods"};
    std::int32_t zeros_ = 0;
    double lowest_ = 1000.0;

    void update() override {
        apply();
        periods.write(static_cast<double>(elapsed()) / static_cast<double>(period()));
    }
    void safe() noexcept override {
        note(*this, "safe");
        apply();
    }
    void apply() noexcept {
        const rtcf::DataStatus status = command.read();
        last_status.write(static_cast<std::int32_t>(status));
        if (status != rtcf::DataStatus::None) held.write(command.value());
        if (status != rtcf::DataStatus::New) return;
        applied.write(command.value());
        if (command.value() == 0.0) zeros.write(++zeros_);
        if (command.value() < lowest_) lowest.write(lowest_ = command.value());
    }
};

// Writes values stored outside the frame: a text, and a large table. May leave both incomplete when
// it throws.
class Author final : public rtcf::Component {
    rtcf::Output<std_msgs::String> text{this, "text"};
    rtcf::Output<std::array<double, 1024>> table{this, "table"};
    rtcf::Parameter<std::int64_t> throws_at{this, "throws_at", -1};
    std::int64_t count_ = 0;

    bool configure() override {
        std_msgs::String longest;
        longest.data = "whole";
        text.reserve(longest);
        return true;
    }
    void update() override {
        const bool throws = count_++ == throws_at;
        text.value().data = "whol";
        table.value()[1023] = 0.5;
        if (throws) throw std::runtime_error("as told");
        text.value().data += 'e';
        table.value()[1023] = 1.0;
        text.publish();
        table.publish();
    }
};

// Outputs how many of the values it read are complete.
class Critic final : public rtcf::Component {
    rtcf::Input<std_msgs::String> text{this, "text"};
    rtcf::Input<std::array<double, 1024>> table{this, "table"};
    rtcf::Output<double> whole{this, "whole"};

    void update() override { look(); }
    void safe() noexcept override { look(); }
    void look() noexcept {
        text.read();
        table.read();
        whole.write((text.value().data == "whole" ? 1.0 : 0.0) + table.value()[1023]);
    }
};

// Outputs the highest value read so far.
class Watcher final : public rtcf::Component {
    rtcf::Input<double> in{this, "in"};
    rtcf::Output<double> highest{this, "highest"};
    double highest_ = -1000.0;

    void update() override {
        if (in.read() != rtcf::DataStatus::None && in.value() > highest_)
            highest.write(highest_ = in.value());
    }
};

}  // namespace

RTCF_COMPONENT(Controller, "Commands 5, and 0 in safe()")
RTCF_COMPONENT(Driver, "Applies new commands")
RTCF_COMPONENT(Author, "Writes a text and a table")
RTCF_COMPONENT(Critic, "Counts complete texts and tables")
RTCF_COMPONENT(Watcher, "Outputs the highest value")

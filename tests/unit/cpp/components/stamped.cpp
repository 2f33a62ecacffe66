// A writer with values of all hooks, and a reader that shows its input.
#include <rtcf/component.hpp>
#include <rtcf/eigen_type.hpp>

namespace {

// Writes `number` plus 0.25 in start(), 0.5 in takeOver(), and whole cycles in each `every`-th
// update().
class Sayer : public rtcf::Component {
   protected:
    rtcf::Parameter<double> number{this, "number", 0.0};
    rtcf::Parameter<bool> starts{this, "starts", false};
    rtcf::Parameter<bool> takes_over{this, "takes_over", false};
    rtcf::Parameter<std::int64_t> every{this, "every", 0};        // 0 = never
    rtcf::Parameter<std::int64_t> in_place{this, "in_place", 0};  // changes without publish()
    rtcf::Output<double> begun{this, "begun"};                    // iteration() in start()

    virtual void say(double value) = 0;
    virtual void change(double by) = 0;

    bool start() override {
        begun.write(static_cast<double>(iteration()));
        if (starts) say(number + 0.25);
        return true;
    }
    void takeOver(const rtcf::Predecessor& /*previous*/) noexcept override {
        if (takes_over) say(number + 0.5);
    }
    void update() override {
        if (every != 0 && iteration() % static_cast<std::uint64_t>(every.value()) == 0)
            say(number + static_cast<double>(iteration()));
        if (in_place != 0 && iteration() % static_cast<std::uint64_t>(in_place.value()) == 0)
            change(1000.0);
    }
};

class PlainSayer final : public Sayer {
    rtcf::Output<double> out{this, "out"};
    void say(double value) override { out.write(value); }
    void change(double by) override { out.value() += by; }
};

class CheckedSayer final : public Sayer {
    rtcf::Output<double> out{this, "out", "", rtcf::Finite()};
    void say(double value) override { out.write(value); }
    void change(double by) override { out.value() += by; }
};

class Listener final : public rtcf::Component {
    rtcf::Input<double> in{this, "in"};
    rtcf::Output<double> value{this, "value"};
    rtcf::Output<double> status{this, "status"};
    rtcf::Output<double> news{this, "news"};  // number of new values
    rtcf::Output<double> wired{this, "wired"};
    rtcf::Output<std::int64_t> written{this, "written"};  // time of the value, ns
    rtcf::State<double> count{this, "count", 0.0};

    void update() override {
        const rtcf::DataStatus read = in.read();
        if (read == rtcf::DataStatus::New) count += 1.0;
        status.write(static_cast<double>(read));
        value.write(in.value());
        news.write(count);
        wired.write(in.connected(this) ? 1.0 : 0.0);
        written.write(time() - in.age(this));
    }
};

// Counts in place, and publishes each `every`-th count.
class Counting final : public rtcf::Component {
    rtcf::Output<double> out{this, "out"};
    rtcf::Output<Eigen::Vector3d> vector{this, "vector"};
    rtcf::Parameter<std::int64_t> every{this, "every", 100};
    rtcf::State<std::int64_t> cycles{this, "cycles", 0};

    bool start() override {
        vector.write(Eigen::Vector3d::Zero());
        return true;
    }
    void update() override {
        out.value() += 1.0;
        vector.value().x() += 1.0;
        if (++cycles % every != 0) return;
        out.publish();
        vector.publish();
    }
};

class VectorListener final : public rtcf::Component {
    rtcf::Input<Eigen::Vector3d> in{this, "in"};
    rtcf::Output<double> value{this, "value"};
    void update() override {
        value.write(in.read() == rtcf::DataStatus::None ? -1.0 : in.value().x());
    }
};

}  // namespace

RTCF_COMPONENT(Counting, "Counts in place")
RTCF_COMPONENT(VectorListener, "Shows the x of a vector")
RTCF_COMPONENT(PlainSayer, "Writes in its hooks")
RTCF_COMPONENT(CheckedSayer, "Writes a finite output in its hooks")
RTCF_COMPONENT(Listener, "Shows its input")

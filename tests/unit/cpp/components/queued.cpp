// Reads messages from queues, and outputs their order.
#include <std_msgs/String.h>

#include <rtcf/component.hpp>

namespace {

class Collector final : public rtcf::Component {
    rtcf::Queue<double, 4> in{this, "in"};
    rtcf::Queue<std_msgs::String, 4> texts{this, "texts"};
    rtcf::Output<double> order{this, "order"};  // digits in order of arrival: 1, 2, 3 is 123
    rtcf::Output<double> waiting{this, "waiting"};
    rtcf::Output<double> dropped{this, "dropped"};
    rtcf::Output<double> letters{this, "letters"};
    rtcf::Parameter<bool> takes{this, "takes", true};
    rtcf::State<double> digits{this, "digits", 0.0};
    rtcf::State<double> characters{this, "characters", 0.0};

    void update() override {
        for (; takes && in.front() != nullptr; in.pop()) digits = digits * 10.0 + *in.front();
        for (; texts.front() != nullptr; texts.pop())
            characters = characters + static_cast<double>(texts.front()->data.size());
        order.write(digits);
        waiting.write(static_cast<double>(in.size()));
        dropped.write(static_cast<double>(in.dropped()));
        letters.write(characters);
    }
};
RTCF_COMPONENT(Collector, "Outputs the messages of queues")

class Digits final : public rtcf::Component {
    rtcf::Output<double> out{this, "out"};

    void update() override { out.write(static_cast<double>(iteration() % 10)); }
};
RTCF_COMPONENT(Digits, "Writes 0 to 9 repeatedly")

}  // namespace

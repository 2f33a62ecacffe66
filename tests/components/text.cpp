// A message of variable size out of the loop, and one into it.
#include <cstdint>
#include <string>

#include <std_msgs/String.h>
#include <rtcf/component.hpp>

namespace {

class Text final : public rtcf::Component {
    rtcf::Output<std_msgs::String> said{this, "said"};
    rtcf::Input<std_msgs::String> heard{this, "heard"};
    rtcf::Output<std::int64_t> length{this, "length"};
    rtcf::Output<std::int64_t> age{this, "age", "ns"};
    rtcf::Parameter<std::int32_t> size{this, "size", 10, rtcf::Min(0), rtcf::Max(1 << 20)};

    bool configure() override {
        std_msgs::String largest;
        largest.data.assign(1 << 20, 'x');
        said.reserve(largest);
        return true;
    }
    void update() override {
        said.value().data.resize(static_cast<std::size_t>(size.value()), 'x');
        said.publish();
        if (heard.read() >= rtcf::DataStatus::Old) {
            length.write(static_cast<std::int64_t>(heard.value().data.size()));
        }
        age.write(heard.age(this));
    }
};

}  // namespace

RTCF_COMPONENT(Text, "Strings of a chosen size")

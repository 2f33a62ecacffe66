// A component with output values of a megabyte.
#include <array>
#include <cstring>
#include <rtcf/component.hpp>

namespace rtcf_unit_test {

struct Picture {
    std::array<std::uint8_t, 1024 * 1024> pixels{};
};

}  // namespace rtcf_unit_test

template <>
struct rtcf::PortType<rtcf_unit_test::Picture> {
    using Picture = rtcf_unit_test::Picture;
    static constexpr bool kFixedSize = true;
    static const char* name() { return "rtcf_unit_test/Picture"; }
    static const char* md5() { return "*"; }
    static const char* rosType() { return name(); }
    static const char* rosMd5() { return md5(); }
    static const char* rosDefinition() { return ""; }
    static std::uint32_t length(const Picture& value) {
        return static_cast<std::uint32_t>(value.pixels.size());
    }
    static void serialize(const Picture& value, std::uint8_t* to, std::uint32_t size) {
        std::memcpy(to, value.pixels.data(), size);
    }
    static void deserialize(Picture& value, const std::uint8_t* from, std::uint32_t size) {
        std::memcpy(value.pixels.data(), from, size);
    }
    static std::string print(const Picture&) { return "a picture"; }
};

namespace {

class Camera final : public rtcf::Component {
    rtcf::Output<rtcf_unit_test::Picture> picture{this, "picture"};

    void update() override { picture.publish(); }
};

}  // namespace

RTCF_COMPONENT(Camera, "Writes large values")

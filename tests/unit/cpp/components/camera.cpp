// A component with output values of a megabyte.
#include <array>
#include <cstring>
#include <rtcf/component.hpp>

namespace rtcf_unit_test {

struct Image {
    std::array<std::uint8_t, 1024 * 1024> pixels{};
};

}  // namespace rtcf_unit_test

template <>
struct rtcf::PortType<rtcf_unit_test::Image> {
    using Image = rtcf_unit_test::Image;
    static constexpr bool kFixedSize = true;
    static const char* name() { return "rtcf_unit_test/Image"; }
    static const char* md5() { return "*"; }
    static const char* rosType() { return name(); }
    static const char* rosMd5() { return md5(); }
    static const char* rosDefinition() { return ""; }
    static std::uint32_t length(const Image& value) {
        return static_cast<std::uint32_t>(value.pixels.size());
    }
    static void serialize(const Image& value, std::uint8_t* to, std::uint32_t size) {
        std::memcpy(to, value.pixels.data(), size);
    }
    static void deserialize(Image& value, const std::uint8_t* from, std::uint32_t size) {
        std::memcpy(value.pixels.data(), from, size);
    }
    static std::string print(const Image&) { return "an image"; }
};

namespace {

class Camera final : public rtcf::Component {
    rtcf::Output<rtcf_unit_test::Image> image{this, "image"};

    void update() override { image.publish(); }
};

}  // namespace

RTCF_COMPONENT(Camera, "Writes large values")

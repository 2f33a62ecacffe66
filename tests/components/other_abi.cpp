// A library as built with headers of another release. It includes none of rtcf's
// headers: only the first two members of the descriptor never change.
#include <cstdint>

namespace {

struct OtherDescriptor {
    std::uint32_t abi_version;
    std::uint32_t size;
};

constexpr std::uint32_t kOtherAbi = 4711;

}  // namespace

extern "C" __attribute__((visibility("default"))) const OtherDescriptor* rtcf_plugin_descriptor() {
    static const OtherDescriptor descriptor{kOtherAbi, sizeof(OtherDescriptor)};
    return &descriptor;
}

// Communicates with a device in each cycle, permitted by RTCF_DEVICE_IO.
#include <fcntl.h>
#include <unistd.h>

#include <cstdint>
#include <rtcf/component.hpp>

namespace {

class Device final : public rtcf::Component {
    rtcf::Output<std::int32_t> written{this, "written"};
    int file_ = -1;
    std::int32_t count_ = 0;

    bool configure() override {
        file_ = ::open("/dev/null", O_WRONLY | O_CLOEXEC);
        return file_ >= 0;
    }
    void update() override {
        {
            RTCF_DEVICE_IO(this);
            if (::write(file_, &count_, sizeof count_) > 0) ++count_;
        }
        written.write(count_);
    }
    void cleanup() override { ::close(file_); }
};

}  // namespace

RTCF_COMPONENT(Device, "Writes to /dev/null")

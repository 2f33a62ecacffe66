// A component whose hooks do not return if a test says so: by the file NAME.HOOK in the folder
// $RTCF_TEST_HANGS, to which the hook writes a byte.
#include <fcntl.h>
#include <unistd.h>

#include <cstdint>
#include <cstdlib>
#include <string>

#include <rtcf/component.hpp>

namespace {

class Hangs final : public rtcf::Component {
   public:
    Hangs() { pass("constructor"); }
    ~Hangs() override { pass("destructor"); }

    bool prepare(const rtcf::Values& /*proposed*/) override { return pass("prepare"); }
    bool configure() override { return pass("configure"); }
    bool start() override { return pass("start"); }
    void update() override {}
    void stop() override { pass("stop"); }
    void cleanup() override { pass("cleanup"); }

   private:
    bool pass(const std::string& hook) const {
        const char* const folder = std::getenv("RTCF_TEST_HANGS");
        if (folder == nullptr) return true;
        const std::string file = std::string(folder) + "/" + name() + "." + hook;
        const int there = ::open(file.c_str(), O_WRONLY | O_CLOEXEC);
        if (there < 0) return true;
        [[maybe_unused]] const ssize_t size = ::write(there, "!", 1);
        // The end of the file does not end the hook.
        for (;;) ::pause();
    }

    rtcf::Parameter<double> gain_{this, "gain", 1.0};
};

}  // namespace

RTCF_COMPONENT(Hangs, "Has hooks that do not return while a test says so")

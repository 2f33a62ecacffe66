// A component that changes the locale of its process, as some libraries of vendors do.
#include <clocale>
#include <cstdlib>

#include "faulty.hpp"

namespace {

class SetsLocale final : public rtcf::Component {
    bool configure() override {
        return std::setlocale(LC_ALL, "") != nullptr ||
               fail("the locale of the environment is unknown");
    }
    void update() override {
        half_.write(std::strtod("0.5", nullptr));  // in the locale of the loop's thread
    }

    rtcf::Output<double> half_{this, "half"};
};

}  // namespace

RTCF_COMPONENT(SetsLocale, "Changes the locale of its process to that of the environment")

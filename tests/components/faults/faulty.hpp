// Base of the faulty components: they behave for some updates first, so that their loop
// is running before the fault.
#pragma once

#include <cstdint>

#include <rtcf/component.hpp>

class Faulty : public rtcf::Component {
   public:
    void update() final {
        out_.write(++updates_);
        if (updates_ > after_) fault();
    }

   private:
    virtual void fault() = 0;

    rtcf::Output<std::int32_t> out_{this, "out"};
    rtcf::Parameter<std::int32_t> after_{this, "after", 20, rtcf::Min(0),
                                         rtcf::Doc("updates without a fault")};
    std::int32_t updates_ = 0;
};

// Failures that components of careless people have.
#include <cstdlib>
#include <exception>
#include <optional>
#include <rtcf/component.hpp>
#include <rtcf/design_period.hpp>
#include <string>

namespace {

const char* missing() { return std::getenv("RTCF_NO_SUCH_VARIABLE"); }

// Has no text where its parameter says.
class Wordless final : public rtcf::Component {
    struct Thrown final : std::exception {
        const char* what() const noexcept override { return nullptr; }
    };

    rtcf::Parameter<std::string> where{this, "where", ""};
    rtcf::Output<double> out{this, "out"};

    bool prepare(const rtcf::Values& proposed) override {
        return proposed[where] != "prepare" || fail("an earlier text");
    }
    bool configure() override {
        if (where.value() == "configure") throw Thrown();
        return where.value() != "fail" || fail("no device {}", missing());
    }
    bool start() override { return where.value() != "start"; }
    void update() override {
        if (where.value() == "update") throw Thrown();
        if (where.value() == "log") RTCF_WARN_ONCE(this, "host {}", missing());
        if (where.value() == "fault") reportFault(missing());
        out.write(1.0);
    }
    void cleanup() override {
        if (where.value() == "cleanup") throw Thrown();
    }
};

class Designed : public rtcf::Component {
   protected:
    bool prepare(const rtcf::Values& /*proposed*/) override {
        of_base_.stage(period_.proposedSeconds());
        return true;
    }
    double ofBase() const { return *of_base_; }

   private:
    rtcf::DesignPeriod period_{this};
    rtcf::Derived<double> of_base_{this};
};

// Computes values for its period, as its base class does.
class DesignedTwice final : public Designed {
    rtcf::DesignPeriod period_{this};
    rtcf::Derived<double> own_{this};
    rtcf::Output<double> base{this, "base"};
    rtcf::Output<double> own{this, "own"};

    bool prepare(const rtcf::Values& proposed) override {
        if (!Designed::prepare(proposed)) return false;
        own_.stage(period_.proposedSeconds());
        return true;
    }
    void update() override {
        base.write(ofBase());
        own.write(*own_);
    }
};

// Drops an input, or declares a parameter as a local variable.
class LosesAMember final : public rtcf::Component {
    std::optional<rtcf::Input<double>> in;
    rtcf::Parameter<bool> local{this, "local", false};

   public:
    LosesAMember() { in.emplace(this, "in"); }

   private:
    bool configure() override {
        if (!local) in.reset();
        if (!local) return true;
        const rtcf::Parameter<double> gain{this, "gain", 1.0};
        return gain > 0.0;
    }
    void update() override {}
};

class ThrowsANumber final : public rtcf::Component {
   public:
    ThrowsANumber() { throw 42; }

   private:
    void update() override {}
};

}  // namespace

RTCF_COMPONENT(Wordless, "Has null texts")
RTCF_COMPONENT(DesignedTwice, "Has two design periods")
RTCF_COMPONENT(LosesAMember, "Has a member that ends before it")
RTCF_COMPONENT(ThrowsANumber, "Has a constructor that throws a number")

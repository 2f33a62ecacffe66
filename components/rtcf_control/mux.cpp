#include <Eigen/Core>

#include <cstddef>
#include <string>

#include <rtcf/component.hpp>
#include <rtcf/eigen_type.hpp>

#include "port_array.hpp"

namespace rtcf_control {
namespace {

template <std::size_t Size>
using Vector = Eigen::Matrix<double, static_cast<int>(Size), 1>;

// Waits for all inputs: a missing one would be a 0 that nobody commands.
template <std::size_t Size>
class Mux : public rtcf::Component {
    Ports<rtcf::Input<double>, Size> in_ = makePorts<rtcf::Input<double>, Size>(this, "in");
    rtcf::Output<Vector<Size>> out{this, "out", "", rtcf::Finite()};

    void update() override {
        bool complete = true;
        Vector<Size> values;
        for (std::size_t i = 0; i < Size; ++i) {
            complete = in_[i]->read() != rtcf::DataStatus::None && complete;
            values[static_cast<Eigen::Index>(i)] = in_[i]->value();
        }
        if (complete) out.write(values);
    }

    // Runs in the last cycle, too, to pass on the safe command of an upstream component.
    void safe() noexcept override { update(); }
};

template <std::size_t Size>
class Demux : public rtcf::Component {
    rtcf::Input<Vector<Size>> in{this, "in"};
    Ports<rtcf::Output<double>, Size> out_ =
        makePorts<rtcf::Output<double>, Size>(this, "out", std::string(), rtcf::Finite());

    void update() override {
        if (in.read() == rtcf::DataStatus::None) return;
        for (std::size_t i = 0; i < Size; ++i)
            out_[i]->write(in.value()[static_cast<Eigen::Index>(i)]);
    }

    // Runs in the last cycle, too, to pass on the safe command of an upstream component.
    void safe() noexcept override { update(); }
};

class Mux2 final : public Mux<2> {};
class Mux3 final : public Mux<3> {};
class Mux6 final : public Mux<6> {};
class Mux7 final : public Mux<7> {};
class Demux2 final : public Demux<2> {};
class Demux3 final : public Demux<3> {};
class Demux6 final : public Demux<6> {};
class Demux7 final : public Demux<7> {};

}  // namespace
}  // namespace rtcf_control

RTCF_COMPONENT_NAMED(rtcf_control::Mux2, "Mux2", "Combines 2 values into a vector", Mux2)
RTCF_COMPONENT_NAMED(rtcf_control::Mux3, "Mux3", "Combines 3 values into a vector", Mux3)
RTCF_COMPONENT_NAMED(rtcf_control::Mux6, "Mux6", "Combines 6 values into a vector", Mux6)
RTCF_COMPONENT_NAMED(rtcf_control::Mux7, "Mux7", "Combines 7 values into a vector", Mux7)
RTCF_COMPONENT_NAMED(rtcf_control::Demux2, "Demux2", "Splits a vector into its 2 values", Demux2)
RTCF_COMPONENT_NAMED(rtcf_control::Demux3, "Demux3", "Splits a vector into its 3 values", Demux3)
RTCF_COMPONENT_NAMED(rtcf_control::Demux6, "Demux6", "Splits a vector into its 6 values", Demux6)
RTCF_COMPONENT_NAMED(rtcf_control::Demux7, "Demux7", "Splits a vector into its 7 values", Demux7)

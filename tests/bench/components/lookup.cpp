// As components/rtcf_examples/python/lookup.py.
#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <rtcf/component.hpp>
#include <utility>

namespace {

constexpr std::array<double, 7> kCurrents{0.0, 1.0, 2.0, 4.0, 6.0, 8.0, 10.0};
constexpr std::array<double, 7> kTorques{0.0, 0.11, 0.23, 0.45, 0.66, 0.83, 0.95};
constexpr std::array<double, 7> kSpeeds{0.0, 50.0, 100.0, 150.0, 200.0, 250.0, 300.0};
constexpr std::array<double, 4> kTemperatures{0.0, 25.0, 50.0, 80.0};
constexpr std::array<std::array<double, 7>, 4> kFriction{{
    {0.080, 0.090, 0.105, 0.125, 0.150, 0.180, 0.215},
    {0.050, 0.058, 0.068, 0.082, 0.100, 0.121, 0.146},
    {0.035, 0.041, 0.049, 0.060, 0.073, 0.089, 0.108},
    {0.028, 0.033, 0.040, 0.049, 0.060, 0.073, 0.089},
}};

// The interval of a value, and its position in the interval.
template <std::size_t Size>
std::pair<std::size_t, double> interval(const std::array<double, Size>& points, double x) {
    const auto after = std::lower_bound(points.begin(), points.end(), x) - points.begin();
    const auto i = static_cast<std::size_t>(
        std::clamp<std::ptrdiff_t>(after - 1, 0, static_cast<std::ptrdiff_t>(Size) - 2));
    return {i, std::clamp((x - points[i]) / (points[i + 1] - points[i]), 0.0, 1.0)};
}

template <std::size_t Size>
double interpolated(double x, const std::array<double, Size>& points,
                    const std::array<double, Size>& values) {
    if (x <= points.front()) return values.front();
    if (x >= points.back()) return values.back();
    const auto after = std::upper_bound(points.begin(), points.end(), x);
    const auto i = static_cast<std::size_t>(after - points.begin()) - 1;
    const double slope = (values[i + 1] - values[i]) / (points[i + 1] - points[i]);
    return slope * (x - points[i]) + values[i];
}

double sign(double x) {
    if (x > 0.0) return 1.0;
    return x < 0.0 ? -1.0 : 0.0;
}

class Lookup final : public rtcf::Component {
    rtcf::Input<double> current{this, "current"};
    rtcf::Input<double> speed{this, "speed"};
    rtcf::Input<double> temperature{this, "temperature"};
    rtcf::Output<double> torque{this, "torque", "N m"};
    rtcf::Parameter<double> scale{this, "scale", 1.0, rtcf::Min(0.5), rtcf::Max(1.5)};

    static double friction(double at_speed, double at_temperature) {
        const auto [i, a] = interval(kTemperatures, at_temperature);
        const auto [k, b] = interval(kSpeeds, std::abs(at_speed));
        const double cold = (1.0 - b) * kFriction[i][k] + b * kFriction[i][k + 1];
        const double warm = (1.0 - b) * kFriction[i + 1][k] + b * kFriction[i + 1][k + 1];
        return (1.0 - a) * cold + a * warm;
    }

    void update() override {
        current.read();
        speed.read();
        temperature.read();
        const double driving =
            sign(current.value()) * interpolated(std::abs(current.value()), kCurrents, kTorques);
        const double braking = sign(speed.value()) * friction(speed.value(), temperature.value());
        torque.write(scale * driving - braking);
    }
};
RTCF_COMPONENT(Lookup, "Torque of a motor at its shaft")

}  // namespace

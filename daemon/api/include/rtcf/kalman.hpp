/// @file
/// Kalman filters: the correction of an estimate by measurements, some of which may be missing, and
/// the base class of extended Kalman filters (Simon, Optimal State Estimation, 2006, chapters 5 and
/// 13). Include this header beside component.hpp.
///
/// A filter is a component with two functions, the motion and the measurements of its states:
///
///     class PendulumFilter final : public rtcf::ExtendedKalmanFilter<2, 1, 1> {
///        public:
///         PendulumFilter()
///             : ExtendedKalmanFilter({{{"angle", "rad"}, {"rate", "rad/s"}}},
///                                    {{{"torque", "N m"}}}, {{{"encoder", "rad"}}}) {}
///
///        private:
///         void predict(State& x, const Input& u, double dt,
///                      StateMatrix& jacobian) const override;
///         void measure(const State& x, Measurement& y,
///                      MeasurementMatrix& jacobian) const override;
///     };
#pragma once

#include <Eigen/Core>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <memory>
#include <string>

#include "rtcf/component.hpp"

namespace rtcf {

/// Name and unit of a state, input or measurement.
struct KalmanSignal {
    std::string name;
    std::string unit;
};

namespace detail {

/// Computes the Cholesky factor L of a symmetric matrix S = L L', in place: L replaces the lower
/// triangle of S. Real-time safe.
/// @return false if the matrix is not positive definite
template <typename Matrix>
bool choleskyInPlace(Matrix& s) noexcept {
    for (Eigen::Index j = 0; j < s.rows(); ++j) {
        double rest = s(j, j);
        for (Eigen::Index k = 0; k < j; ++k) rest -= s(j, k) * s(j, k);
        if (!(rest > 0.0) || !std::isfinite(rest)) return false;
        s(j, j) = std::sqrt(rest);
        for (Eigen::Index i = j + 1; i < s.rows(); ++i) {
            double below = s(i, j);
            for (Eigen::Index k = 0; k < j; ++k) below -= s(i, k) * s(j, k);
            s(i, j) = below / s(j, j);
        }
    }
    return true;
}

/// Solves L y = b for each column of b. Real-time safe.
template <typename Factor, typename Matrix>
void solveForward(const Factor& l, Matrix& b) noexcept {
    for (Eigen::Index column = 0; column < b.cols(); ++column) {
        for (Eigen::Index i = 0; i < l.rows(); ++i) {
            double sum = b(i, column);
            for (Eigen::Index k = 0; k < i; ++k) sum -= l(i, k) * b(k, column);
            b(i, column) = sum / l(i, i);
        }
    }
}

/// Solves L' y = b for each column of b. Real-time safe.
template <typename Factor, typename Matrix>
void solveBackward(const Factor& l, Matrix& b) noexcept {
    for (Eigen::Index column = 0; column < b.cols(); ++column) {
        for (Eigen::Index i = l.rows() - 1; i >= 0; --i) {
            double sum = b(i, column);
            for (Eigen::Index k = i + 1; k < l.rows(); ++k) sum -= l(k, i) * b(k, column);
            b(i, column) = sum / l(i, i);
        }
    }
}

}  // namespace detail

/// Result of correctEstimate().
struct KalmanCorrection {
    bool valid = true;       ///< false = the covariance is not positive definite; nothing changed
    std::uint32_t used = 0;  ///< number of measurements used
    /// innovation' S^-1 innovation: about `used` if the noises are right
    double squared_error = 0.0;
};

/// Corrects an estimate by the measurements that are present, in Joseph's form, which keeps the
/// covariance symmetric and positive. Real-time safe for matrices of fixed or bounded size.
/// @param x           estimate
/// @param covariance  its covariance
/// @param innovation  measured minus expected values
/// @param observation d(measurements) / d(states)
/// @param noise       covariance of the measurements, positive definite
/// @param present     bit i is set if measurement i is present
template <typename State, typename Covariance, typename Measurement, typename Observation,
          typename Noise>
KalmanCorrection correctEstimate(State& x, Covariance& covariance, const Measurement& innovation,
                                 const Observation& observation, const Noise& noise,
                                 std::uint64_t present) noexcept {
    constexpr int kStates = State::MaxRowsAtCompileTime;
    constexpr int kMeasured = Measurement::MaxRowsAtCompileTime;
    static_assert(kStates > 0 && kMeasured > 0, "the sizes have an upper bound");
    // Eigen requires column-major order of a column, and row-major order of a row.
    constexpr int kOrder = kStates == 1 ? Eigen::ColMajor : Eigen::RowMajor;
    using Rows = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, kOrder, kMeasured, kStates>;
    using Square = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, 0, kMeasured, kMeasured>;
    using Some = Eigen::Matrix<double, Eigen::Dynamic, 1, 0, kMeasured, 1>;

    std::array<Eigen::Index, static_cast<std::size_t>(kMeasured)> rows{};
    Eigen::Index count = 0;
    for (Eigen::Index i = 0; i < innovation.rows(); ++i) {
        if ((present >> static_cast<unsigned>(i) & 1U) != 0)
            rows[static_cast<std::size_t>(count++)] = i;
    }
    if (count == 0) return {};
    Rows h(count, x.rows());
    Square r(count, count);
    Some e(count);
    for (Eigen::Index i = 0; i < count; ++i) {
        const Eigen::Index row = rows[static_cast<std::size_t>(i)];
        h.row(i) = observation.row(row);
        e[i] = innovation[row];
        for (Eigen::Index j = 0; j < count; ++j)
            r(i, j) = noise(row, rows[static_cast<std::size_t>(j)]);
    }
    Rows gain = h.lazyProduct(covariance);  // transposed
    Square s = gain.lazyProduct(h.transpose());
    s += r;
    if (!detail::choleskyInPlace(s)) return {false, 0, 0.0};
    detail::solveForward(s, gain);
    detail::solveBackward(s, gain);
    Some weighted = e;
    detail::solveForward(s, weighted);

    Covariance kept = Covariance::Identity(x.rows(), x.rows());
    kept -= gain.transpose().lazyProduct(h);
    const Covariance half = kept.lazyProduct(covariance);
    const Rows spread = r.lazyProduct(gain);
    Covariance corrected = half.lazyProduct(kept.transpose());
    corrected += gain.transpose().lazyProduct(spread);
    x += gain.transpose().lazyProduct(e);
    covariance = 0.5 * (corrected + corrected.transpose());
    return {true, static_cast<std::uint32_t>(count), weighted.squaredNorm()};
}

/// Base class of extended Kalman filters. It has
///  - an input for each input and each measurement of the model,
///  - an output for each state, and STATE_deviation with its standard deviation,
///  - the outputs `used`, the number of measurements in this cycle, and `age`, the time since the
///    last one,
///  - the parameters STATE_initial and STATE_deviation (of the first estimate), STATE_noise and
///    MEASUREMENT_noise.
///
/// In each cycle, the filter advances its estimate by the time since the last cycle, and corrects
/// it by the new measurements. A measurement without a new value, or that is not finite, is
/// missing. The filter begins at the first measurement.
template <int States, int Inputs, int Measurements>
class ExtendedKalmanFilter : public Component {
    static_assert(States > 0 && Inputs >= 0 && Measurements > 0 && Measurements <= 64,
                  "a filter has states, and 1 to 64 measurements");

   public:
    using State = Eigen::Matrix<double, States, 1>;
    using Input = Eigen::Matrix<double, Inputs, 1>;
    using Measurement = Eigen::Matrix<double, Measurements, 1>;
    using StateMatrix = Eigen::Matrix<double, States, States>;
    using MeasurementMatrix = Eigen::Matrix<double, Measurements, States>;
    template <int Size>
    using Signals = std::array<KalmanSignal, static_cast<std::size_t>(Size)>;

    bool start() override {
        begun_ = false;
        return true;
    }
    void update() override;
    /// Updates the estimate in the last cycle, too.
    void safe() noexcept override { update(); }

   protected:
    /// @param states       names and units of the states: outputs
    /// @param inputs       names and units of the inputs
    /// @param measurements names and units of the measurements: inputs
    ExtendedKalmanFilter(const Signals<States>& states, const Signals<Inputs>& inputs,
                         const Signals<Measurements>& measurements);

    /// Advances the states by `dt`. Real-time.
    /// @param x        states; the function replaces them by those after `dt`
    /// @param u        inputs, constant during `dt`
    /// @param dt       s
    /// @param jacobian 0; the function fills in d(new states) / d(old states)
    virtual void predict(State& x, const Input& u, double dt, StateMatrix& jacobian) const = 0;
    /// Computes the expected measurements. Real-time.
    /// @param y        the function fills in the expected measurements
    /// @param jacobian 0; the function fills in d(measurements) / d(states)
    virtual void measure(const State& x, Measurement& y, MeasurementMatrix& jacobian) const = 0;
    /// Returns the measured minus the expected values. Override it for angles, to remove whole
    /// turns from their differences. Real-time.
    virtual Measurement innovation(const Measurement& measured, const Measurement& expected) const {
        return measured - expected;
    }

    /// The present estimate. Real-time safe.
    const State& estimate() const noexcept { return state_.value(); }

   private:
    template <typename T, int Size>
    using Ports = std::array<std::unique_ptr<T>, static_cast<std::size_t>(Size)>;
    using Number = Parameter<double>;

    template <typename T, int Size>
    static State valuesOf(const Ports<T, Size>& parameters);
    bool readInputs(Input& u);
    void reject();

    Ports<rtcf::Input<double>, Inputs> inputs_;
    Ports<rtcf::Input<double>, Measurements> measurements_;
    Ports<Output<double>, States> outputs_;
    Ports<Output<double>, States> deviations_;
    Output<std::uint32_t> used{this, "used"};
    Output<double> age{this, "age", "s", Finite()};
    Ports<Number, States> initial_;
    Ports<Number, States> first_deviation_;
    Ports<Number, States> noise_;
    Ports<Number, Measurements> measurement_noise_;

    rtcf::State<State> state_{this, "estimate", State::Zero(), Doc("estimate of the last cycle")};
    rtcf::State<StateMatrix> covariance_{this, "covariance", StateMatrix::Zero(),
                                         Doc("covariance of the estimate")};
    rtcf::State<std::array<double, static_cast<std::size_t>(Inputs) + 1>> last_input_{
        this, "last_input", {}, Doc("inputs of the last cycle, and 0")};
    rtcf::State<double> age_{this, "measurement_age", 0.0, Unit("s"),
                             Doc("time since the last measurement")};
    rtcf::State<bool> begun_{this, "begun", false, Doc("the estimate is valid")};
};

template <int States, int Inputs, int Measurements>
ExtendedKalmanFilter<States, Inputs, Measurements>::ExtendedKalmanFilter(
    const Signals<States>& states, const Signals<Inputs>& inputs,
    const Signals<Measurements>& measurements) {
    for (std::size_t i = 0; i < inputs.size(); ++i)
        inputs_[i] = std::make_unique<rtcf::Input<double>>(this, inputs[i].name);
    for (std::size_t i = 0; i < measurements.size(); ++i) {
        const KalmanSignal& signal = measurements[i];
        measurements_[i] = std::make_unique<rtcf::Input<double>>(this, signal.name);
        measurement_noise_[i] = std::make_unique<Number>(
            this, signal.name + "_noise", 1.0, Min(1e-150), Unit(signal.unit),
            Doc("standard deviation of the measurement"));
    }
    for (std::size_t i = 0; i < states.size(); ++i) {
        const KalmanSignal& signal = states[i];
        outputs_[i] = std::make_unique<Output<double>>(this, signal.name, signal.unit, Finite());
        deviations_[i] = std::make_unique<Output<double>>(this, signal.name + "_deviation",
                                                          signal.unit, Finite());
        initial_[i] = std::make_unique<Number>(this, signal.name + "_initial", 0.0,
                                               Unit(signal.unit), Doc("first estimate"));
        first_deviation_[i] = std::make_unique<Number>(
            this, signal.name + "_deviation", 1.0, Min(0.0), Unit(signal.unit),
            Doc("standard deviation of the first estimate"));
        noise_[i] = std::make_unique<Number>(
            this, signal.name + "_noise", 0.0, Min(0.0), Unit(signal.unit + "/sqrt(s)"),
            Doc("standard deviation that the model's error adds in 1 s"));
    }
}

template <int States, int Inputs, int Measurements>
void ExtendedKalmanFilter<States, Inputs, Measurements>::update() {
    Measurement measured = Measurement::Zero();
    std::uint64_t present = 0;
    for (std::size_t i = 0; i < measurements_.size(); ++i) {
        const bool is_new = measurements_[i]->read() == DataStatus::New;
        const double value = measurements_[i]->value();
        if (!is_new || !std::isfinite(value)) continue;
        measured[static_cast<Eigen::Index>(i)] = value;
        present |= std::uint64_t{1} << i;
    }
    Input u = Input::Zero();
    const bool usable = readInputs(u);
    if (!begun_ && present == 0) return;

    State x;
    StateMatrix covariance;
    if (begun_) {
        StateMatrix jacobian = StateMatrix::Zero();
        x = state_.value();
        predict(x, u, dt(), jacobian);
        const StateMatrix half = jacobian.lazyProduct(covariance_.value());
        covariance = half.lazyProduct(jacobian.transpose());
        for (Eigen::Index i = 0; i < States; ++i) {
            const double deviation = *noise_[static_cast<std::size_t>(i)];
            covariance(i, i) += deviation * deviation * dt();
        }
        age_ += dt();
    } else {
        covariance.setZero();
        for (Eigen::Index i = 0; i < States; ++i) {
            const double deviation = *first_deviation_[static_cast<std::size_t>(i)];
            x[i] = *initial_[static_cast<std::size_t>(i)];
            covariance(i, i) = deviation * deviation;
        }
    }

    Measurement expected = Measurement::Zero();
    MeasurementMatrix observation = MeasurementMatrix::Zero();
    measure(x, expected, observation);
    Eigen::Matrix<double, Measurements, Measurements> noise;
    noise.setZero();
    for (Eigen::Index i = 0; i < Measurements; ++i) {
        const double deviation = *measurement_noise_[static_cast<std::size_t>(i)];
        noise(i, i) = deviation * deviation;
    }
    const KalmanCorrection correction =
        correctEstimate(x, covariance, innovation(measured, expected), observation, noise, present);
    if (!correction.valid || !x.allFinite() || !covariance.allFinite()) {
        reject();
        return;
    }
    if (present != 0) age_ = 0.0;
    begun_ = true;
    state_ = x;
    covariance_ = covariance;
    if (!usable) {
        reject();
        return;
    }
    for (Eigen::Index i = 0; i < States; ++i) {
        outputs_[static_cast<std::size_t>(i)]->write(x[i]);
        deviations_[static_cast<std::size_t>(i)]->write(std::sqrt(std::max(covariance(i, i), 0.0)));
    }
    used.write(correction.used);
    age.write(age_);
}

// Reads the inputs. An input that is not finite keeps its last value; the result is false then.
template <int States, int Inputs, int Measurements>
bool ExtendedKalmanFilter<States, Inputs, Measurements>::readInputs(Input& u) {
    bool usable = true;
    for (std::size_t i = 0; i < inputs_.size(); ++i) {
        inputs_[i]->read();
        const double value = inputs_[i]->value();
        usable = usable && std::isfinite(value);
        if (std::isfinite(value)) last_input_.value()[i] = value;
        u[static_cast<Eigen::Index>(i)] = last_input_.value()[i];
    }
    return usable;
}

// Writes values that the check of Finite outputs rejects, so that readers keep the last estimate.
template <int States, int Inputs, int Measurements>
void ExtendedKalmanFilter<States, Inputs, Measurements>::reject() {
    for (const std::unique_ptr<Output<double>>& output : outputs_)
        output->write(std::numeric_limits<double>::quiet_NaN());
}

}  // namespace rtcf

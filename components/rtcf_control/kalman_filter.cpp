#include <Eigen/Core>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <string>
#include <utility>

#include <rtcf/component.hpp>
#include <rtcf/design_period.hpp>
#include <rtcf/kalman.hpp>

#include "linear/discretisation.hpp"
#include "linear/matrix_text.hpp"
#include "linear/small_matrix.hpp"
#include "linear/steady_filter.hpp"
#include "port_array.hpp"

namespace rtcf_control {
namespace {

class KalmanFilter final : public rtcf::Component {
    static constexpr std::size_t kPorts = kMostStates;
    using MatrixXd = Eigen::MatrixXd;
    // Declared state.
    using Numbers = Eigen::Matrix<double, kMostStates, 1>;
    using Square = Eigen::Matrix<double, kMostStates, kMostStates>;

    enum class Form { Zoh, Discrete };
    enum class InputTime { Present, Previous };

    // Matrices for one period of the loop.
    struct Design {
        SmallMatrix a, b, c, d;  // discrete
        SmallMatrix process_noise, measurement_noise;
        SmallVector initial;
        SmallMatrix initial_covariance;
        SmallMatrix gain;                  // steady: estimate by innovation
        SmallMatrix corrected_covariance;  // steady
        bool steady = false;
        bool previous = false;  // the input acts from the last cycle to this one
    };

    Ports<rtcf::Input<double>, kPorts> in_ = makePorts<rtcf::Input<double>, kPorts>(this, "in");
    Ports<rtcf::Input<double>, kPorts> measured_ =
        makePorts<rtcf::Input<double>, kPorts>(this, "measured");
    Ports<rtcf::Output<double>, kPorts> out_ =
        makePorts<rtcf::Output<double>, kPorts>(this, "out", std::string(), rtcf::Finite());
    Ports<rtcf::Output<double>, kPorts> deviation_ =
        makePorts<rtcf::Output<double>, kPorts>(this, "deviation", std::string(), rtcf::Finite());
    rtcf::Output<std::uint32_t> used{this, "used"};
    rtcf::Output<double> squared_error{this, "squared_error", "", rtcf::Finite()};
    rtcf::Output<double> age{this, "age", "s", rtcf::Finite()};

    rtcf::Parameter<std::string> a{
        this, "A", "0", rtcf::Doc("matrix of the states, rows separated by ;, up to 12 x 12")};
    rtcf::Parameter<std::string> b{this, "B", "1",
                                   rtcf::Doc("matrix of the inputs; empty = no inputs")};
    rtcf::Parameter<std::string> c{this, "C", "",
                                   rtcf::Doc("matrix of the measurements; empty = all states")};
    rtcf::Parameter<std::string> d{this, "D", "",
                                   rtcf::Doc("matrix from inputs to measurements; empty = 0")};
    rtcf::Parameter<Form> form{
        this,
        "form",
        Form::Zoh,
        rtcf::Choice("zoh", Form::Zoh),
        rtcf::Choice("discrete", Form::Discrete),
        rtcf::Doc("A, B and process_noise: continuous, discretised exactly for a held input; or "
                  "discrete for this period")};
    rtcf::Parameter<std::string> process_noise{
        this, "process_noise", "1",
        rtcf::Doc("of the states: intensity (unit^2/s), for discrete covariance per cycle; matrix, "
                  "diagonal or one number")};
    rtcf::Parameter<std::string> measurement_noise{
        this, "measurement_noise", "1",
        rtcf::Doc("covariance of the measurements (unit^2); matrix, diagonal or one number")};
    rtcf::Parameter<std::string> initial{
        this, "initial", "0",
        rtcf::Doc("first estimate: one number for all states, or one for each")};
    rtcf::Parameter<std::string> initial_covariance{
        this, "initial_covariance", "1",
        rtcf::Doc("covariance of the first estimate (unit^2); matrix, diagonal or one number")};
    rtcf::Parameter<bool> steady{
        this, "steady", false,
        rtcf::Doc("use the gain of the steady state in all cycles; for measurements of one rate")};
    rtcf::Parameter<InputTime> input_time{
        this,
        "input_time",
        InputTime::Present,
        rtcf::Choice("present", InputTime::Present),
        rtcf::Choice("previous", InputTime::Previous),
        rtcf::Doc("in acts from this cycle on, or has acted since the last one (in is a loop "
                  "break)")};
    rtcf::Parameter<double> measurement_timeout{
        this,
        "measurement_timeout",
        std::numeric_limits<double>::infinity(),
        rtcf::Min(0.0),
        rtcf::Unit("s"),
        rtcf::Doc("longest time without any new finite measured value; then out has no new value")};

    rtcf::Derived<Design> design_{this};
    rtcf::DesignPeriod design_period_{this};
    rtcf::State<Numbers> state_{this, "estimate", Numbers::Zero(),
                                rtcf::Doc("estimate of the last cycle")};
    rtcf::State<Square> covariance_{this, "covariance", Square::Zero(),
                                    rtcf::Doc("its covariance")};
    rtcf::State<Numbers> predicted_{this, "predicted", Numbers::Zero(),
                                    rtcf::Doc("estimate for this cycle, as predicted in the last")};
    rtcf::State<Square> spread_{this, "predicted_covariance", Square::Zero(),
                                rtcf::Doc("its covariance")};
    rtcf::State<Numbers> input_{this, "last_input", Numbers::Zero(),
                                rtcf::Doc("input of the last cycle")};
    rtcf::State<std::int32_t> states_{this, "states", 0, rtcf::Doc("number of states")};
    rtcf::State<std::int64_t> period_{this, "predicted_period", 0, rtcf::Unit("ns"),
                                      rtcf::Doc("time by which the estimate is predicted")};
    rtcf::State<double> age_{this, "measurement_age", 0.0, rtcf::Unit("s"),
                             rtcf::Doc("time since the last measurement")};
    rtcf::State<bool> begun_{this, "begun", false, rtcf::Doc("the estimate is valid")};

    bool prepare(const rtcf::Values& proposed) override {
        Design design;
        if (const std::string error = designed(proposed, design); !error.empty())
            return RTCF_FAIL(this, "{}", error);
        design_.stage(std::move(design));
        return true;
    }

    // Returns empty, or the error.
    std::string designed(const rtcf::Values& proposed, Design& made) const {
        MatrixXd a_given;
        MatrixXd b_given;
        MatrixXd c_given;
        MatrixXd d_given;
        if (std::string error = readSystem({proposed[a], proposed[b], proposed[c], proposed[d]},
                                           a_given, b_given, c_given, d_given);
            !error.empty())
            return error;
        const auto n = static_cast<int>(a_given.rows());
        const auto p = static_cast<int>(c_given.rows());
        if (n == 0) return "A: a filter needs at least one state";
        made.previous = proposed[input_time] == InputTime::Previous;
        if (made.previous && !d_given.isZero(0.0)) return "D must be 0 if input_time = previous";
        MatrixXd noise;
        MatrixXd uncertain;
        MatrixXd first_covariance;
        Eigen::VectorXd first;
        std::string error = readWeight("process_noise", proposed[process_noise], n, false, noise);
        if (error.empty())
            error =
                readWeight("measurement_noise", proposed[measurement_noise], p, true, uncertain);
        if (error.empty()) error = readVector("initial", proposed[initial], n, first);
        if (error.empty())
            error = readWeight("initial_covariance", proposed[initial_covariance], n, false,
                               first_covariance);
        if (!error.empty()) return error;
        if (proposed[form] == Form::Zoh) {
            const double period_s = design_period_.proposedSeconds();
            noise = sampledNoise(a_given, noise, period_s);
            DiscreteSystem discrete = zeroOrderHold(a_given, b_given, period_s);
            if (!discrete.a.allFinite() || !discrete.b.allFinite() || !noise.allFinite())
                return fmt::format("A and B are too large for a period of {} s", period_s);
            a_given = std::move(discrete.a);
            b_given = std::move(discrete.b);
        }
        made.a = a_given;
        made.b = b_given;
        made.c = c_given;
        made.d = d_given;
        made.process_noise = noise;
        made.measurement_noise = uncertain;
        made.initial = first;
        made.initial_covariance = first_covariance;
        made.steady = proposed[steady];
        return made.steady ? steadyState(made) : std::string();
    }

    static std::string steadyState(Design& made) {
        const MatrixXd a = made.a;
        const MatrixXd c = made.c;
        if (const std::string error = steadyFilterError(a, c, made.process_noise); !error.empty())
            return error + ", so there is no steady state";
        const auto found = steadyFilter(a, c, made.process_noise, made.measurement_noise);
        if (!found)
            return "the Riccati equation has no solution: scale the noises and the matrices";
        const MatrixXd& gain = found->gain;
        const MatrixXd kept = MatrixXd::Identity(a.rows(), a.rows()) - gain * c;
        made.gain = gain;
        made.corrected_covariance =
            MatrixXd(kept * found->predicted_covariance * kept.transpose() +
                     gain * MatrixXd(made.measurement_noise) * gain.transpose());
        return {};
    }

    bool start() override {
        begun_ = false;
        return true;
    }

    void update() override {
        const Design& design = *design_;
        std::uint64_t present = 0;
        const SmallVector measured = readMeasurements(present);
        bool usable = true;
        const SmallVector u = readInputs(usable);
        if (!begun_ && present == 0) return;
        if (!begun_) begin();
        if (states_ != design.a.rows()) resize();

        SmallVector x;
        SmallMatrix covariance;
        moveOn(u, x, covariance);
        const rtcf::KalmanCorrection correction = correct(measured, u, present, x, covariance);
        if (!correction.valid || !x.allFinite() || !covariance.allFinite()) {
            reject();
            return;
        }
        age_ = present != 0 ? 0.0 : age_ + dt();
        if (age_ > measurement_timeout) {
            reportFault("no measured value within measurement_timeout: out has no new value");
            age.write(age_);
        } else {
            write(x, covariance, correction, usable);
        }
        keep(u, x, covariance);
    }

    // Updates the estimate in the last cycle, too.
    void safe() noexcept override { update(); }

    // A measurement without a new value, or that is not finite, is missing.
    SmallVector readMeasurements(std::uint64_t& present) {
        SmallVector values = SmallVector::Zero(design_->c.rows());
        for (Eigen::Index i = 0; i < values.size(); ++i) {
            rtcf::Input<double>& port = *measured_[static_cast<std::size_t>(i)];
            const bool is_new = port.read() == rtcf::DataStatus::New;
            if (!is_new || !std::isfinite(port.value())) continue;
            values[i] = port.value();
            present |= std::uint64_t{1} << static_cast<unsigned>(i);
        }
        return values;
    }

    // Inputs that are not finite keep their last values.
    SmallVector readInputs(bool& usable) {
        SmallVector values = input_->head(design_->b.cols());
        for (Eigen::Index i = 0; i < values.size(); ++i) {
            rtcf::Input<double>& port = *in_[static_cast<std::size_t>(i)];
            port.read();
            usable = usable && std::isfinite(port.value());
            if (std::isfinite(port.value())) values[i] = port.value();
        }
        return values;
    }

    void begin() {
        states_ = 0;  // all states are new
        input_->setZero();
        period_ = 0;
        age_ = 0.0;
        begun_ = true;
    }

    // Sets new states to their first estimates.
    void resize() {
        const Design& design = *design_;
        const Eigen::Index now = design.a.rows();
        const Eigen::Index old = std::min<Eigen::Index>(states_, now);
        for (Numbers* x : {&state_.value(), &predicted_.value()}) {
            x->tail(kMostStates - old).setZero();
            x->segment(old, now - old) = design.initial.tail(now - old);
        }
        for (Square* covariance : {&covariance_.value(), &spread_.value()}) {
            covariance->rightCols(kMostStates - old).setZero();
            covariance->bottomRows(kMostStates - old).setZero();
            covariance->block(old, old, now - old, now - old) =
                design.initial_covariance.bottomRightCorner(now - old, now - old);
        }
        states_ = static_cast<std::int32_t>(now);
    }

    // Advances the estimate to this cycle. If the elapsed time is the predicted period, the stored
    // prediction is exact, even if the period has changed since then; otherwise, the model advances
    // the estimate by the elapsed time.
    void moveOn(const SmallVector& u, SmallVector& x, SmallMatrix& covariance) const {
        const Design& design = *design_;
        const Eigen::Index n = design.a.rows();
        x = state_->head(n);
        covariance = covariance_->topLeftCorner(n, n);
        if (period_ == 0) return;
        const SmallVector held = design.previous ? u : SmallVector(input_->head(u.size()));
        if (elapsed() == period_) {
            x = predicted_->head(n);
            covariance = spread_->topLeftCorner(n, n);
            if (design.previous) x += design.b.lazyProduct(held);
            return;
        }
        for (std::int64_t i = modelSteps(elapsed(), period()); i > 0; --i) {
            x = (design.a.lazyProduct(x) + design.b.lazyProduct(held)).eval();
            covariance = predictedCovariance(covariance);
        }
    }

    rtcf::KalmanCorrection correct(const SmallVector& measured, const SmallVector& u,
                                   std::uint64_t present, SmallVector& x,
                                   SmallMatrix& covariance) const {
        const Design& design = *design_;
        SmallVector innovation = measured - design.c.lazyProduct(x);
        if (!design.previous) innovation -= design.d.lazyProduct(u);
        if (!design.steady)
            return rtcf::correctEstimate(x, covariance, innovation, design.c,
                                         design.measurement_noise, present);
        // correctEstimate() only computes the squared error, from the predicted covariance.
        SmallVector unused = x;
        SmallMatrix predicted = covariance;
        const rtcf::KalmanCorrection correction = rtcf::correctEstimate(
            unused, predicted, innovation, design.c, design.measurement_noise, present);
        for (Eigen::Index i = 0; i < innovation.size(); ++i) {
            if ((present >> static_cast<unsigned>(i) & 1U) == 0) innovation[i] = 0.0;
        }
        x += design.gain.lazyProduct(innovation);
        covariance = design.corrected_covariance;
        return correction;
    }

    SmallMatrix predictedCovariance(const SmallMatrix& covariance) const {
        const Design& design = *design_;
        const SmallMatrix half = design.a.lazyProduct(covariance);
        SmallMatrix next = half.lazyProduct(design.a.transpose());
        next += design.process_noise;
        return 0.5 * (next + next.transpose());
    }

    // Stores the estimate, and predicts that of the next cycle. After an overflow, the state stays
    // unchanged.
    void keep(const SmallVector& u, const SmallVector& x, const SmallMatrix& covariance) {
        const Design& design = *design_;
        SmallVector next = design.a.lazyProduct(x);
        if (!design.previous) next += design.b.lazyProduct(u);
        const SmallMatrix spread = predictedCovariance(covariance);
        if (!next.allFinite() || !spread.allFinite()) return;
        state_->head(x.size()) = x;
        covariance_->topLeftCorner(spread.rows(), spread.cols()) = covariance;
        predicted_->head(next.size()) = next;
        spread_->topLeftCorner(spread.rows(), spread.cols()) = spread;
        input_->setZero();
        input_->head(u.size()) = u;
        period_ = period();
    }

    void write(const SmallVector& x, const SmallMatrix& covariance,
               const rtcf::KalmanCorrection& correction, bool usable) {
        if (!usable) {
            reject();
            return;
        }
        for (Eigen::Index i = 0; i < x.size(); ++i) {
            out_[static_cast<std::size_t>(i)]->write(x[i]);
            deviation_[static_cast<std::size_t>(i)]->write(
                std::sqrt(std::max(covariance(i, i), 0.0)));
        }
        used.write(correction.used);
        squared_error.write(correction.squared_error);
        age.write(age_);
    }

    // Writes values that the check of Finite outputs rejects, so that readers keep the last
    // estimate.
    void reject() {
        for (Eigen::Index i = 0; i < design_->a.rows(); ++i)
            out_[static_cast<std::size_t>(i)]->write(std::numeric_limits<double>::quiet_NaN());
    }
};

}  // namespace
}  // namespace rtcf_control

RTCF_COMPONENT_NAMED(rtcf_control::KalmanFilter, "KalmanFilter",
                     "Kalman filter of up to 12 states, in Joseph's form, also with missing "
                     "measurements (Simon, Optimal State Estimation, 2006, chapters 5 and 7)",
                     KalmanFilter)

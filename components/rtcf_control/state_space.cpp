#include <Eigen/LU>
#include <Eigen/QR>

#include <algorithm>
#include <cmath>
#include <complex>
#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <cstring>
#include <limits>
#include <optional>
#include <sstream>
#include <string>
#include <utility>
#include <vector>

#include <rtcf/component.hpp>
#include <rtcf/design_period.hpp>

#include "linear/discretisation.hpp"
#include "linear/matrix_text.hpp"
#include "linear/pole_placement.hpp"
#include "linear/riccati.hpp"
#include "linear/small_matrix.hpp"
#include "linear/steady_filter.hpp"
#include "measurement_watch.hpp"
#include "port_array.hpp"

namespace rtcf_control {
namespace {

class StateSpace final : public rtcf::Component {
    static constexpr std::size_t kPorts = kMostStates;
    using MatrixXd = Eigen::MatrixXd;
    // Declared state.
    using Numbers = Eigen::Matrix<double, kMostStates, 1>;

    enum class Form { Zoh, Tustin, Discrete };
    enum class Role { System, Observer, Regulator, Lqg };
    enum class Gain { Kalman, Poles };
    enum class InputTime { Present, Previous };

    // For one period of the loop.
    struct Design {
        Role role = Role::System;
        SmallMatrix a, b, c, d;    // a, b: discrete
        SmallMatrix half;          // Tustin: factor of a change of the input
        SmallMatrix correction;    // estimate by innovation
        SmallMatrix feedback;      // output by estimate
        SmallMatrix state_target;  // state and input that hold a setpoint
        SmallMatrix input_target;
        SmallVector initial, lower, upper, safe;
        int inputs = 0;              // in1 to in<inputs>
        int measured = 0;            // measured1 to measured<measured>
        int outputs = 0;             // out1 to out<outputs>
        bool previous = false;       // the input of a cycle has acted since the last one
        std::uint64_t identity = 0;  // hash of all that makes the output jump
    };

    Ports<rtcf::Input<double>, kPorts> in_ = makePorts<rtcf::Input<double>, kPorts>(this, "in");
    Ports<rtcf::Input<double>, kPorts> measured_ =
        makePorts<rtcf::Input<double>, kPorts>(this, "measured");
    Ports<rtcf::Output<double>, kPorts> out_ =
        makePorts<rtcf::Output<double>, kPorts>(this, "out", std::string(), rtcf::Finite());

    rtcf::Parameter<std::string> a{
        this, "A", "0", rtcf::Doc("matrix of the states, rows separated by ;, up to 12 x 12")};
    rtcf::Parameter<std::string> b{this, "B", "1",
                                   rtcf::Doc("matrix of the inputs; empty = no inputs")};
    rtcf::Parameter<std::string> c{
        this, "C", "", rtcf::Doc("matrix of the outputs, or measurements; empty = all states")};
    rtcf::Parameter<std::string> d{this, "D", "",
                                   rtcf::Doc("matrix from inputs to outputs; empty = 0")};
    rtcf::Parameter<Form> form{
        this,
        "form",
        Form::Zoh,
        rtcf::Choice("zoh", Form::Zoh),
        rtcf::Choice("tustin", Form::Tustin),
        rtcf::Choice("discrete", Form::Discrete),
        rtcf::Doc(
            "A and B: continuous, discretised exactly for a held input or by Tustin's method; "
            "or discrete for this period")};
    rtcf::Parameter<Role> role{
        this,
        "role",
        Role::System,
        rtcf::Choice("system", Role::System),
        rtcf::Choice("observer", Role::Observer),
        rtcf::Choice("regulator", Role::Regulator),
        rtcf::Choice("lqg", Role::Lqg),
        rtcf::Doc("the system itself, an estimate of its states, LQR feedback of measured states, "
                  "or LQR feedback of estimated states")};
    rtcf::Parameter<Gain> observer{
        this,
        "observer",
        Gain::Kalman,
        rtcf::Choice("kalman", Gain::Kalman),
        rtcf::Choice("poles", Gain::Poles),
        rtcf::Doc("gain of the observer: steady-state Kalman filter, or Luenberger by "
                  "observer_poles")};
    rtcf::Parameter<std::string> observer_poles{
        this, "observer_poles", "",
        rtcf::Doc("poles of the observer, one for each state: in 1/s, for discrete in z; "
                  "\"-3 -2+1j -2-1j\"")};
    rtcf::Parameter<std::string> process_noise{
        this, "process_noise", "1",
        rtcf::Doc("of the states: intensity (unit^2/s), for discrete covariance per cycle; matrix, "
                  "diagonal or one number")};
    rtcf::Parameter<std::string> measurement_noise{
        this, "measurement_noise", "1",
        rtcf::Doc("covariance of the measurements (unit^2); matrix, diagonal or one number")};
    rtcf::Parameter<std::string> state_cost{
        this, "state_cost", "1",
        rtcf::Doc(
            "LQR: weight of the states, per time, for discrete per cycle; matrix, diagonal or "
            "one number")};
    rtcf::Parameter<std::string> input_cost{this, "input_cost", "1",
                                            rtcf::Doc("LQR: weight of the inputs, as state_cost")};
    rtcf::Parameter<std::string> tracked{
        this, "tracked", "",
        rtcf::Doc(
            "LQR: numbers of the rows of C that follow in1, in2 ...; empty = all states to 0")};
    rtcf::Parameter<InputTime> input_time{
        this,
        "input_time",
        InputTime::Present,
        rtcf::Choice("present", InputTime::Present),
        rtcf::Choice("previous", InputTime::Previous),
        rtcf::Doc("observer: in acts from this cycle on, or has acted since the last one (in is a "
                  "loop break)")};
    rtcf::Parameter<std::string> initial{
        this, "initial", "0", rtcf::Doc("first state: one number for all states, or one for each")};
    rtcf::Parameter<std::string> lower{
        this, "lower", "-1e300",
        rtcf::Doc("LQR: lower limit of out: one number for all, or one for each")};
    rtcf::Parameter<std::string> upper{
        this, "upper", "1e300",
        rtcf::Doc("LQR: upper limit of out: one number for all, or one for each")};
    rtcf::Parameter<std::string> safe_value{
        this, "safe_value", "0",
        rtcf::Doc("LQR: out in the last cycle, and while a measured value is lost, within the "
                  "limits: one number for all, or one for each")};
    rtcf::Parameter<double> fade{
        this,           "fade",          0.1,
        rtcf::Min(0.0), rtcf::Unit("s"), rtcf::Doc("time of the transition to other matrices")};
    MeasurementWatch<kPorts> watch_{this, numberedNames<kPorts>("measured"),
                                    "out = safe_value, an observer writes nothing"};

    rtcf::Derived<Design> design_{this};
    rtcf::DesignPeriod design_period_{this};
    rtcf::State<Numbers> state_{this, "states", Numbers::Zero(),
                                rtcf::Doc("states of the last cycle")};
    rtcf::State<Numbers> predicted_{this, "predicted", Numbers::Zero(),
                                    rtcf::Doc("states of this cycle, as predicted in the last")};
    rtcf::State<Numbers> input_{this, "last_input", Numbers::Zero(),
                                rtcf::Doc("input of the last cycle")};
    rtcf::State<Numbers> output_{this, "last_output", Numbers::Zero(),
                                 rtcf::Doc("out of the last cycle")};
    rtcf::State<Numbers> offset_{this, "offset", Numbers::Zero(),
                                 rtcf::Doc("differences that a transition adds to out")};
    rtcf::State<double> fading_{this, "fading", 0.0, rtcf::Unit("s"),
                                rtcf::Doc("time left of the transition")};
    rtcf::State<double> blind_{this, "blind", 0.0, rtcf::Unit("s"),
                               rtcf::Doc("time since all inputs were finite")};
    rtcf::State<std::int64_t> period_{this, "predicted_period", 0, rtcf::Unit("ns"),
                                      rtcf::Doc("time by which the states are predicted")};
    rtcf::State<std::uint64_t> identity_{this, "design_identity", 0,
                                         rtcf::Doc("hash of the matrices of the last cycle")};
    rtcf::State<std::int32_t> written_{this, "written", 0,
                                       rtcf::Doc("number of outputs in the last cycle")};
    rtcf::State<bool> begun_{this, "begun", false, rtcf::Doc("the states are valid")};

    // The model and its design, of any size. Its functions return an error, or empty.
    struct Designer {
        Designer(const rtcf::Values& values, const StateSpace& component, double period)
            : proposed(values), of(component), period_s(period) {}

        const rtcf::Values& proposed;
        const StateSpace& of;
        double period_s;
        Design made;
        MatrixXd a, b, c, d;     // as given
        MatrixXd moved, driven;  // discrete a, b

        int states() const { return static_cast<int>(a.rows()); }
        int inputs() const { return static_cast<int>(b.cols()); }
        int outputs() const { return static_cast<int>(c.rows()); }
        Form form() const { return proposed[of.form]; }

        std::string design() {
            made.role = proposed[of.role];
            if (std::string error = readModel(); !error.empty()) return error;
            if (std::string error = discretise(); !error.empty()) return error;
            const bool observes = made.role == Role::Observer || made.role == Role::Lqg;
            const bool regulates = made.role == Role::Regulator || made.role == Role::Lqg;
            if ((observes || regulates) && form() == Form::Tustin)
                return "form: tustin is for role = system; use zoh";
            if ((observes || regulates) && states() == 0)
                return "A: this role needs at least one state";
            if (observes) {
                if (std::string error = designObserver(); !error.empty()) return error;
            }
            if (regulates) {
                if (std::string error = designRegulator(); !error.empty()) return error;
            }
            setPorts();
            identify();
            return {};
        }

        std::string readModel() {
            if (std::string error = readSystem(
                    {proposed[of.a], proposed[of.b], proposed[of.c], proposed[of.d]}, a, b, c, d);
                !error.empty())
                return error;
            return initialState();
        }

        std::string initialState() {
            Eigen::VectorXd first;
            std::string error = readVector("initial", proposed[of.initial], states(), first);
            if (error.empty()) made.initial = first;
            return error;
        }

        std::string discretise() {
            moved = a;
            driven = b;
            made.half = SmallMatrix::Zero(states(), inputs());
            if (states() > 0 && form() == Form::Zoh) {
                DiscreteSystem found = zeroOrderHold(a, b, period_s);
                moved = std::move(found.a);
                driven = std::move(found.b);
            } else if (states() > 0 && form() == Form::Tustin) {
                std::optional<DiscreteSystem> found = tustin(a, b, period_s);
                if (!found)
                    return fmt::format(
                        "A has an eigenvalue of {} 1/s, which tustin cannot have at "
                        "this period; use zoh",
                        2.0 / period_s);
                moved = std::move(found->a);
                driven = std::move(found->b);
                made.half = 0.5 * driven;
            }
            if (!moved.allFinite() || !driven.allFinite())
                return fmt::format("A and B are too large for a period of {} s", period_s);
            made.a = moved;
            made.b = driven;
            made.c = c;
            made.d = d;
            return {};
        }

        // The estimate of this cycle by its innovation: "current estimator" (Franklin, Powell &
        // Workman, section 8.2).
        std::string designObserver() {
            made.previous =
                made.role == Role::Observer && proposed[of.input_time] == InputTime::Previous;
            if ((made.previous || made.role == Role::Lqg) && !d.isZero(0.0))
                return made.previous ? "D must be 0 if input_time = previous"
                                     : "D must be 0 for role = lqg";
            return proposed[of.observer] == Gain::Kalman ? kalmanGain() : luenbergerGain();
        }

        std::string kalmanGain() {
            MatrixXd noise;
            MatrixXd uncertain;
            std::string error =
                readWeight("process_noise", proposed[of.process_noise], states(), false, noise);
            if (error.empty())
                error = readWeight("measurement_noise", proposed[of.measurement_noise], outputs(),
                                   true, uncertain);
            if (!error.empty()) return error;
            if (form() != Form::Discrete) noise = sampledNoise(a, noise, period_s);
            error = steadyFilterError(moved, c, noise);
            if (!error.empty()) return error;
            const auto found = steadyFilter(moved, c, noise, uncertain);
            if (!found)
                return "the Riccati equation of the observer has no solution: scale the noises "
                       "and the matrices";
            made.correction = found->gain;
            return {};
        }

        std::string luenbergerGain() {
            std::vector<std::complex<double>> poles;
            if (std::string error = readPoles(proposed[of.observer_poles], poles); !error.empty())
                return "observer_poles: " + error;
            if (poles.size() != static_cast<std::size_t>(states()))
                return fmt::format("observer_poles has {} numbers, and A has {} states",
                                   poles.size(), states());
            for (std::complex<double>& pole : poles) {
                const std::complex<double> given = pole;
                if (form() != Form::Discrete) pole = std::exp(period_s * pole);
                if (std::abs(pole) >= 1.0)
                    return fmt::format("observer_poles: {} is not stable", complexText(given));
            }
            // The error of the estimate moves by (1 - M C) A.
            const auto gain = placePoles(moved.transpose(), (c * moved).transpose(), poles);
            if (!gain)
                return "A, C: the measurements do not show all modes, as observer_poles needs; use "
                       "observer = kalman";
            made.correction = MatrixXd(gain->transpose());
            if (spectralRadius(moved - gain->transpose() * c * moved) >= 1.0)
                return "observer_poles: rounding makes the observer unstable; choose other poles";
            return {};
        }

        std::string designRegulator() {
            if (inputs() == 0) return "B is empty: LQR needs an input";
            MatrixXd q;
            MatrixXd r;
            std::string error =
                readWeight("state_cost", proposed[of.state_cost], states(), false, q);
            if (error.empty())
                error = readWeight("input_cost", proposed[of.input_cost], inputs(), true, r);
            if (!error.empty()) return error;
            SampledCost cost{q, MatrixXd::Zero(states(), inputs()), r};
            if (form() != Form::Discrete) cost = sampledCost(a, b, q, r, period_s);
            if (const auto mode = unstabilizableMode(moved, driven))
                return "A, B: the inputs do not move the mode at z = " + complexText(*mode);
            const MatrixXd without = cost.r.ldlt().solve(cost.n.transpose());
            if (const auto mode = unstabilizableMode((moved - driven * without).transpose(),
                                                     cost.q - cost.n * without))
                return "A, state_cost: no cost weighs the mode at z = " + complexText(*mode);
            const auto found = solveRiccati(moved, driven, cost.q, cost.r, &cost.n);
            if (!found)
                return "the Riccati equation of the regulator has no solution: scale the costs "
                       "and the matrices";
            made.feedback = found->k;
            error = designTargets();
            return error.empty() ? readLimits() : error;
        }

        // State and input that hold the tracked outputs at their setpoints.
        std::string designTargets() {
            std::istringstream words(proposed[of.tracked]);
            std::vector<int> rows;
            for (std::string word; words >> word;) {
                char* end = nullptr;
                const long row = std::strtol(word.c_str(), &end, 10);
                if (*end != '\0' || row < 1 || row > outputs())
                    return fmt::format("tracked: {} is not a row of C, 1 to {}", word, outputs());
                if (std::find(rows.begin(), rows.end(), row) != rows.end())
                    return fmt::format("tracked: {} is there twice", row);
                rows.push_back(static_cast<int>(row));
            }
            const int n = states();
            const int m = inputs();
            const int count = static_cast<int>(rows.size());
            if (count > m)
                return fmt::format("tracked: {} outputs cannot follow with {} inputs", count, m);
            MatrixXd system = MatrixXd::Zero(n + count, n + m);
            system.topLeftCorner(n, n) = moved - MatrixXd::Identity(n, n);
            system.topRightCorner(n, m) = driven;
            for (int i = 0; i < count; ++i) {
                const int row = rows[static_cast<std::size_t>(i)] - 1;
                system.row(n + i) << c.row(row), d.row(row);
            }
            MatrixXd wanted = MatrixXd::Zero(n + count, count);
            wanted.bottomRows(count).setIdentity();
            MatrixXd target = MatrixXd::Zero(n + m, count);
            if (count > 0) {
                // Rows of the dynamics are small for a short period.
                const Eigen::VectorXd size = system.rowwise().norm();
                for (int i = 0; i < n + count; ++i) {
                    if (size[i] > 0.0) system.row(i) /= size[i];
                    if (size[i] > 0.0) wanted.row(i) /= size[i];
                }
                target = system.completeOrthogonalDecomposition().solve(wanted);
                if (!((system * target - wanted).norm() <= 1e-8 * wanted.norm()))
                    return "tracked: these outputs cannot hold any setpoint, e.g. a velocity whose "
                           "position is a state";
            }
            made.state_target = MatrixXd(target.topRows(n));
            made.input_target = MatrixXd(target.bottomRows(m));
            return {};
        }

        std::string readLimits() {
            Eigen::VectorXd low;
            Eigen::VectorXd high;
            Eigen::VectorXd safe;
            std::string error = readVector("lower", proposed[of.lower], inputs(), low);
            if (error.empty()) error = readVector("upper", proposed[of.upper], inputs(), high);
            if (error.empty())
                error = readVector("safe_value", proposed[of.safe_value], inputs(), safe);
            if (!error.empty()) return error;
            for (int i = 0; i < inputs(); ++i) {
                if (low[i] > high[i])
                    return fmt::format("out{}: lower = {} is above upper = {}", i + 1, low[i],
                                       high[i]);
            }
            made.lower = low;
            made.upper = high;
            made.safe = safe.cwiseMax(low).cwiseMin(high);
            return {};
        }

        void setPorts() {
            const bool regulates = made.role == Role::Regulator || made.role == Role::Lqg;
            made.inputs = regulates ? static_cast<int>(made.state_target.cols()) : inputs();
            if (made.role == Role::Regulator) made.measured = states();
            if (made.role == Role::Observer || made.role == Role::Lqg) made.measured = outputs();
            made.outputs = outputs();
            if (made.role == Role::Observer) made.outputs = states();
            if (regulates) made.outputs = inputs();
        }

        // The output of a system does not jump if only its period changes, and that of an observer
        // never does.
        void identify() {
            std::uint64_t hash = rtcf::detail::stateHash(static_cast<std::uint64_t>(made.role),
                                                         rtcf::detail::stateHash("design"));
            const auto add = [&hash](const MatrixXd& matrix) {
                hash = rtcf::detail::stateHash(static_cast<std::uint64_t>(matrix.cols()), hash);
                for (const double element : matrix.reshaped()) {
                    std::uint64_t bits = 0;
                    std::memcpy(&bits, &element, sizeof bits);
                    hash = rtcf::detail::stateHash(bits, hash);
                }
            };
            if (made.role == Role::System) {
                for (const MatrixXd* each : {&a, &b, &c, &d}) add(*each);
                hash = rtcf::detail::stateHash(static_cast<std::uint64_t>(form()), hash);
            } else if (made.role != Role::Observer) {
                for (const SmallMatrix* each :
                     {&made.feedback, &made.state_target, &made.input_target})
                    add(*each);
            }
            made.identity = hash;
        }
    };

    bool prepare(const rtcf::Values& proposed) override {
        Designer designer(proposed, *this, design_period_.proposedSeconds());
        if (const std::string error = designer.design(); !error.empty())
            return RTCF_FAIL(this, "{}", error);
        design_.stage(std::move(designer.made));
        return true;
    }

    bool start() override {
        begun_ = false;
        blind_ = 0.0;
        watch_.begin();
        return true;
    }

    void update() override {
        const Design& design = *design_;
        const SmallVector in = read(in_, design.inputs);
        bool lost = false;
        const SmallVector measured = readMeasured(design.measured, lost);
        if (!begun_ && !complete(design.measured)) return;
        const bool finite = in.allFinite() && measured.allFinite();
        blind_ = finite ? 0.0 : blind_ + dt();
        if (!finite || lost) {
            const bool regulates = design.role == Role::Regulator || design.role == Role::Lqg;
            const bool stops = regulates && (lost || blind_ > watch_.timeout());
            if (stops) {
                writeSafe(design);
            } else if (!finite) {
                reject();
            }
            if (begun_ && (design.role == Role::Observer || design.role == Role::Lqg))
                coast(design, in, stops);
            return;
        }
        if (!begun_) begin(design);
        SmallVector x = moved(design, in);
        SmallVector u = in;
        SmallVector y;
        switch (design.role) {
            case Role::System:
                x += design.half.lazyProduct(u - input_->head(design.inputs));
                y = design.c.lazyProduct(x) + design.d.lazyProduct(u);
                break;
            case Role::Observer:
                x += correct(design, x, measured, u);
                y = x;
                break;
            case Role::Regulator:
                x = measured;
                y = feedback(design, x, in);
                break;
            case Role::Lqg:
                x += correct(design, x, measured, SmallVector::Zero(design.outputs));
                y = feedback(design, x, in);
                break;
        }
        if (identity_ != design.identity) beginTransition(design, y);
        y += offset_->head(design.outputs);
        if (design.role == Role::Regulator || design.role == Role::Lqg) {
            y = y.cwiseMax(design.lower).cwiseMin(design.upper);
            u = y;
        }
        if (!y.allFinite() || !x.allFinite()) {
            reject();
            return;
        }
        for (int i = 0; i < design.outputs; ++i) out_[static_cast<std::size_t>(i)]->write(y[i]);
        output_->setZero();
        output_->head(design.outputs) = y;
        written_ = design.outputs;
        identity_ = design.identity;
        keep(design, x, u);
        endCycleOfTransition();
    }

    // Systems and observers run in the last cycle, too, to pass on the safe command of an upstream
    // component. Other roles write safe_value.
    void safe() noexcept override {
        const Design& design = *design_;
        if (design.role == Role::System || design.role == Role::Observer) {
            update();
            return;
        }
        writeSafe(design);
    }

    void writeSafe(const Design& design) noexcept {
        for (int i = 0; i < design.outputs; ++i)
            out_[static_cast<std::size_t>(i)]->write(design.safe[i]);
    }

    // Inputs without a value count as 0.
    static SmallVector read(Ports<rtcf::Input<double>, kPorts>& ports, int count) {
        SmallVector values(count);
        for (int i = 0; i < count; ++i) {
            rtcf::Input<double>& port = *ports[static_cast<std::size_t>(i)];
            port.read();
            values[i] = port.value();
        }
        return values;
    }

    SmallVector readMeasured(int count, bool& lost) {
        SmallVector values(count);
        for (int i = 0; i < count; ++i) {
            const auto at = static_cast<std::size_t>(i);
            rtcf::Input<double>& port = *measured_[at];
            const rtcf::DataStatus status = port.read();
            values[i] = port.value();
            if (status == rtcf::DataStatus::None) continue;
            const char* const fault = watch_.note(at, port.value(), port.age(this), elapsed());
            if (fault != nullptr) reportFault(fault);
            lost = lost || watch_.lost(at);
        }
        return values;
    }

    bool complete(int count) const {
        return std::all_of(measured_.begin(), measured_.begin() + count,
                           [](const auto& port) { return port->hasValue(); });
    }

    // Rejected as not finite: readers keep the last outputs.
    void reject() {
        for (int i = 0; i < design_->outputs; ++i)
            out_[static_cast<std::size_t>(i)]->write(std::numeric_limits<double>::quiet_NaN());
    }

    void begin(const Design& design) {
        state_->setZero();
        state_->head(design.initial.size()) = design.initial;
        input_->setZero();
        offset_->setZero();
        fading_ = 0.0;
        identity_ = design.identity;
        period_ = 0;
        begun_ = true;
    }

    // The states of this cycle: the prediction, which is exact also if the period has changed, or
    // by the time that has really passed.
    SmallVector moved(const Design& design, const SmallVector& in) const {
        const Eigen::Index n = design.a.rows();
        SmallVector x = state_->head(n);
        if (design.role == Role::Regulator || period_ == 0) return x;
        const SmallVector held = design.previous ? in : SmallVector(input_->head(design.b.cols()));
        if (elapsed() == period_) {
            x = predicted_->head(n);
            if (design.previous) x += design.b.lazyProduct(held);
            return x;
        }
        for (std::int64_t i = modelSteps(elapsed(), period()); i > 0; --i)
            x = (design.a.lazyProduct(x) + design.b.lazyProduct(held)).eval();
        return x;
    }

    static SmallVector correct(const Design& design, const SmallVector& x,
                               const SmallVector& measured, const SmallVector& u) {
        SmallVector innovation = measured - design.c.lazyProduct(x);
        if (!design.previous && design.role == Role::Observer)
            innovation -= design.d.lazyProduct(u);
        return design.correction.lazyProduct(innovation);
    }

    static SmallVector feedback(const Design& design, const SmallVector& x,
                                const SmallVector& setpoint) {
        const SmallVector away = x - design.state_target.lazyProduct(setpoint);
        return design.input_target.lazyProduct(setpoint) - design.feedback.lazyProduct(away);
    }

    // Predicts the states of the next cycle.
    void keep(const Design& design, const SmallVector& x, const SmallVector& u) {
        SmallVector next = x;
        if (design.role != Role::Regulator) {
            next = design.a.lazyProduct(x);
            if (!design.previous) next += design.b.lazyProduct(u);
        }
        if (!next.allFinite()) return;
        state_->setZero();
        state_->head(x.size()) = x;
        predicted_->setZero();
        predicted_->head(next.size()) = next;
        input_->setZero();
        input_->head(u.size()) = u;
        period_ = period();
    }

    // A cycle without usable measurements: the states move on with the last input.
    void coast(const Design& design, const SmallVector& in, bool stops) {
        SmallVector u = input_->head(design.b.cols());
        if (design.role == Role::Observer && in.allFinite()) u = in;
        if (stops) u = design.safe;
        const SmallVector x = moved(design, u);
        keep(design, x, u);
    }

    // The outputs continue from their last values.
    void beginTransition(const Design& design, const SmallVector& y) {
        const int common = std::min<int>(written_, design.outputs);
        offset_->setZero();
        fading_ = 0.0;
        if (fade <= 0.0) return;
        offset_->head(common) = output_->head(common) - y.head(common);
        if (!offset_->allFinite()) offset_->setZero();
        fading_ = fade.value();
    }

    void endCycleOfTransition() {
        if (fading_ <= 0.0) return;
        const double left = fading_ - dt();
        offset_ *= left > 0.0 ? left / fading_ : 0.0;
        fading_ = std::max(left, 0.0);
    }
};

}  // namespace
}  // namespace rtcf_control

RTCF_COMPONENT_NAMED(
    rtcf_control::StateSpace, "StateSpace",
    "Linear system of up to 12 states, its observer, LQR or LQG controller "
    "(Franklin, Powell & Workman, Digital Control of Dynamic Systems, 3rd edition, "
    "1998, chapters 4, 8 and 9)",
    StateSpace)

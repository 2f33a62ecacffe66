#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include <sensor_msgs/JointState.h>
#include <trajectory_msgs/JointTrajectory.h>
#include <trajectory_msgs/JointTrajectoryPoint.h>

#include <rtcf/component.hpp>
#include <rtcf/read_number.hpp>

#include "bounded_step.hpp"
#include "joint_names.hpp"
#include "trajectory/stop_motion.hpp"
#include "trajectory/synchronized_motion.hpp"
#include "trajectory/trajectory_points.hpp"
#include "words.hpp"

namespace rtcf_control {
namespace {

class TrajectoryGenerator final : public rtcf::Component {
    static_assert(kMostJoints == SynchronizedMotion::kMostAxes);
    // Of a trajectory from a component of the loop, without allocation.
    static constexpr std::size_t kReservedPoints = 128;
    // Rounding errors of positions and velocities that are compared with their limits, relative.
    static constexpr double kLimitTolerance = 1e-9;

    enum class SafePosition { Present, Stop };

    using Numbers = std::array<double, kMostJoints>;
    using Motions = std::array<Motion, kMostJoints>;
    using Strings = std::vector<std::string>;

    static double seconds(std::int64_t ns) { return 1e-9 * static_cast<double>(ns); }
    // At most some hundred years.
    static std::int64_t nanoseconds(double seconds) {
        return std::llround(std::min(1e9 * seconds, 4e18));
    }

    // From the parameters.
    struct Setup {
        Strings joints;
        std::array<MotionLimits, kMostJoints> limits{};
        Numbers lower{};
        Numbers upper{};
        Numbers initial{};
        bool has_initial = false;
    };

    enum class Kind : std::int64_t { Stop, Target };

    // The motion that is under way when there is no trajectory. It determines the plan, so that the
    // plan itself is no state.
    struct Task {
        Kind kind = Kind::Stop;
        std::int64_t joints = 0;
        std::int64_t begin_ns = 0;
        Numbers position{};
        Numbers velocity{};
        Numbers acceleration{};
        Numbers target_position{};
        Numbers target_velocity{};
        Numbers velocity_limit{};
        Numbers acceleration_limit{};
        Numbers jerk_limit{};
        Numbers lower_limit{};
        Numbers upper_limit{};

        Motion begin(std::size_t i) const { return {position[i], velocity[i], acceleration[i]}; }
        MotionTarget target(std::size_t i) const {
            return {target_position[i], target_velocity[i]};
        }
        MotionLimits limits(std::size_t i) const {
            return {velocity_limit[i], acceleration_limit[i], jerk_limit[i]};
        }
        PositionRange allowed(std::size_t i) const { return {lower_limit[i], upper_limit[i]}; }
        void setBegin(std::size_t i, const Motion& motion) {
            position[i] = motion.position;
            velocity[i] = motion.velocity;
            acceleration[i] = motion.acceleration;
        }
        void setLimits(std::size_t i, const Setup& setup) {
            velocity_limit[i] = setup.limits[i].velocity;
            acceleration_limit[i] = setup.limits[i].acceleration;
            jerk_limit[i] = setup.limits[i].jerk;
            lower_limit[i] = setup.lower[i];
            upper_limit[i] = setup.upper[i];
        }
        bool operator!=(const Task& other) const {
            if (kind != other.kind || joints != other.joints || begin_ns != other.begin_ns)
                return true;
            for (std::size_t i = 0; i < static_cast<std::size_t>(joints); ++i) {
                if (position[i] != other.position[i] || velocity[i] != other.velocity[i] ||
                    acceleration[i] != other.acceleration[i] ||
                    target_position[i] != other.target_position[i] ||
                    target_velocity[i] != other.target_velocity[i] ||
                    velocity_limit[i] != other.velocity_limit[i] ||
                    acceleration_limit[i] != other.acceleration_limit[i] ||
                    jerk_limit[i] != other.jerk_limit[i] ||
                    lower_limit[i] != other.lower_limit[i] ||
                    upper_limit[i] != other.upper_limit[i])
                    return true;
            }
            return false;
        }
        template <typename Visit>
        void fields(Visit&& visit) {
            visit("kind", kind);
            visit("joints", joints);
            visit("begin_ns", begin_ns);
            visit("position", position);
            visit("velocity", velocity);
            visit("acceleration", acceleration);
            visit("target_position", target_position);
            visit("target_velocity", target_velocity);
            visit("velocity_limit", velocity_limit);
            visit("acceleration_limit", acceleration_limit);
            visit("jerk_limit", jerk_limit);
            visit("lower_limit", lower_limit);
            visit("upper_limit", upper_limit);
        }
    };

    // The motions of a task. A target with a velocity is followed by a stop.
    struct Plan {
        Task task;
        SynchronizedMotion motion;
        std::array<StopMotion, kMostJoints> stops;
        std::int64_t target_ns = 0;  // duration up to the target
        std::int64_t end_ns = 0;     // duration up to the end of the stops

        // Returns an error of a target that cannot be planned; a stop always can.
        PlanError make(const Task& wanted) {
            task = wanted;
            const auto count = static_cast<std::size_t>(task.joints);
            target_ns = 0;
            if (task.kind == Kind::Target) {
                std::array<AxisTask, kMostJoints> axes{};
                for (std::size_t i = 0; i < count; ++i)
                    axes[i] = {task.begin(i), task.target(i), task.limits(i)};
                if (const PlanError error = motion.plan(axes.data(), count);
                    error != PlanError::None)
                    return error;
                target_ns = nanoseconds(motion.duration());
            }
            double longest = 0.0;
            for (std::size_t i = 0; i < count; ++i) {
                if (task.kind == Kind::Target) {
                    // Within the limits of position as well, or the target is rejected.
                    const MotionTarget at = task.target(i);
                    stops[i] = StopMotion({at.position, at.velocity, 0.0}, task.limits(i));
                } else {
                    stops[i] = StopMotion(task.begin(i), task.limits(i), task.allowed(i));
                }
                longest = std::max(longest, stops[i].duration());
            }
            end_ns = target_ns + nanoseconds(longest);
            return PlanError::None;
        }
        Motion at(std::size_t joint, std::int64_t time) const {
            const std::int64_t since = time - task.begin_ns;
            if (since >= end_ns) return {stops[joint].end(), 0.0, 0.0};
            return since < target_ns ? motion.at(joint, seconds(since))
                                     : stops[joint].at(seconds(since - target_ns));
        }
        // Share of the duration that has passed.
        double progress(std::int64_t time) const {
            const std::int64_t since = time - task.begin_ns;
            return since >= end_ns ? 1.0 : static_cast<double>(since) / static_cast<double>(end_ns);
        }
        // The positions that a joint passes.
        PositionRange range(std::size_t joint) const {
            PositionRange range = stops[joint].range();
            if (task.kind == Kind::Target) {
                const PositionRange before = motion.axis(joint).range();
                range.add(before.lower);
                range.add(before.upper);
            }
            return range;
        }
    };

    // Follows from the state, or is lost with its object.
    struct Memory {
        explicit Memory(std::size_t joints) : points(joints) {}
        std::array<Plan, 2> plans;
        std::size_t current = 0;
        TrajectoryPoints points;
        std::uint64_t points_id = 0;
        std::optional<std::uint64_t> dropped;          // by the queue, up to the last cycle
        std::array<std::size_t, kMostJoints> order{};  // index of each joint in a message
    };

    rtcf::Input<sensor_msgs::JointState> measured{this, "measured"};
    rtcf::Input<sensor_msgs::JointState> target{this, "target"};
    rtcf::Queue<trajectory_msgs::JointTrajectory, 8> trajectory{this, "trajectory"};
    rtcf::Input<bool> halt{this, "halt"};
    rtcf::Input<bool> idle{this, "idle"};
    rtcf::Output<sensor_msgs::JointState> command{this, "command", "", rtcf::Finite()};
    rtcf::Output<trajectory_msgs::JointTrajectoryPoint> point{this, "point", "", rtcf::Finite()};
    rtcf::Output<double> progress{this, "progress", "", rtcf::Finite()};
    rtcf::Output<bool> done{this, "done"};
    rtcf::Output<std::uint32_t> rejected{this, "rejected"};

    rtcf::Parameter<std::string> joints{this, "joints", "joint1",
                                        rtcf::Doc("names of 1 to 16 joints"), rtcf::Fixed()};
    rtcf::Parameter<std::string> velocity{
        this, "velocity", "1", rtcf::Unit("1/s"),
        rtcf::Doc("largest velocity: one number for all joints, or one for each")};
    rtcf::Parameter<std::string> acceleration{
        this, "acceleration", "1", rtcf::Unit("1/s^2"),
        rtcf::Doc("largest acceleration: one number for all joints, or one for each")};
    rtcf::Parameter<std::string> jerk{
        this, "jerk", "10", rtcf::Unit("1/s^3"),
        rtcf::Doc("largest jerk: one number for all joints, or one for each")};
    rtcf::Parameter<std::string> lower{
        this, "lower", "-inf",
        rtcf::Doc("lowest position: one number for all joints, or one for each")};
    rtcf::Parameter<std::string> upper{
        this, "upper", "inf",
        rtcf::Doc("highest position: one number for all joints, or one for each")};
    rtcf::Parameter<std::string> initial{
        this, "initial", "",
        rtcf::Doc("positions at the start if measured has no value; empty: wait for it")};
    rtcf::Parameter<SafePosition> safe_position{
        this,
        "safe_position",
        SafePosition::Present,
        rtcf::Choice("present", SafePosition::Present),
        rtcf::Choice("stop", SafePosition::Stop),
        rtcf::Doc("position in the last cycle: the present one, or the end of the fastest stop")};
    rtcf::Parameter<double> measurement_timeout{
        this,           "measurement_timeout", 0.2,
        rtcf::Min(0.0), rtcf::Unit("s"),       rtcf::Doc("largest age of measured at the start")};
    rtcf::Derived<Setup> setup_{this};

    rtcf::State<bool> begun_{this, "begun", false, rtcf::Doc("the start position is known"),
                             rtcf::Live()};
    rtcf::State<bool> halted_{this, "halted", false, rtcf::Doc("stopped by halt or idle"),
                              rtcf::Live()};
    rtcf::State<std::int64_t> time_{
        this, "time", 0, rtcf::Unit("ns"), rtcf::Doc("time since the start"), rtcf::Live()};
    rtcf::State<Task> task_{
        this, "task", {}, rtcf::Doc("motion to a target, or stop"), rtcf::Live()};
    rtcf::State<Numbers> position_{
        this, "position", {}, rtcf::Doc("commanded position"), rtcf::Live()};
    rtcf::State<Numbers> velocity_{
        this,        "commanded_velocity", {}, rtcf::Unit("1/s"), rtcf::Doc("commanded velocity"),
        rtcf::Live()};
    rtcf::State<Numbers> acceleration_{this,
                                       "commanded_acceleration",
                                       {},
                                       rtcf::Unit("1/s^2"),
                                       rtcf::Doc("commanded acceleration"),
                                       rtcf::Live()};
    rtcf::State<std::uint64_t> points_id_{this, "trajectory_number", 0,
                                          rtcf::Doc("number of the trajectory; 0 = none"),
                                          rtcf::Live()};
    rtcf::State<std::uint64_t> last_id_{this, "last_trajectory_number", 0,
                                        rtcf::Doc("number of the last trajectory"), rtcf::Live()};
    rtcf::State<std::uint32_t> last_seq_{this, "last_trajectory_seq", 0,
                                         rtcf::Doc("header.seq of the last trajectory"),
                                         rtcf::Live()};
    rtcf::State<std::int64_t> points_begin_{this,
                                            "trajectory_begin",
                                            0,
                                            rtcf::Unit("ns"),
                                            rtcf::Doc("time at which the trajectory begins"),
                                            rtcf::Live()};
    rtcf::State<std::uint32_t> rejected_{this, "rejections", 0,
                                         rtcf::Doc("number of rejected targets and trajectories")};

    std::unique_ptr<Memory> memory_;

    bool prepare(const rtcf::Values& proposed) override {
        Setup setup;
        setup.joints = words(proposed[joints]);
        const std::size_t count = setup.joints.size();
        if (const std::string why = jointsError(setup.joints); !why.empty()) return fail(why);
        Numbers numbers{};
        constexpr Condition kLimit{[](double x) { return std::isfinite(x) && x > 0.0; },
                                   "finite and above 0"};
        constexpr Condition kNumber{[](double x) { return !std::isnan(x); }, "a number"};
        constexpr Condition kPosition{[](double x) { return std::isfinite(x); }, "finite"};
        if (!read("velocity", proposed[velocity], count, numbers, kLimit)) return false;
        for (std::size_t i = 0; i < count; ++i) setup.limits[i].velocity = numbers[i];
        if (!read("acceleration", proposed[acceleration], count, numbers, kLimit)) return false;
        for (std::size_t i = 0; i < count; ++i) setup.limits[i].acceleration = numbers[i];
        if (!read("jerk", proposed[jerk], count, numbers, kLimit)) return false;
        for (std::size_t i = 0; i < count; ++i) setup.limits[i].jerk = numbers[i];
        if (!read("lower", proposed[lower], count, setup.lower, kNumber)) return false;
        if (!read("upper", proposed[upper], count, setup.upper, kNumber)) return false;
        for (std::size_t i = 0; i < count; ++i) {
            if (setup.lower[i] > setup.upper[i])
                return RTCF_FAIL(this, "joint {}: lower = {} is above upper = {}", setup.joints[i],
                                 setup.lower[i], setup.upper[i]);
        }
        setup.has_initial = !words(proposed[initial]).empty();
        if (setup.has_initial &&
            !read("initial", proposed[initial], count, setup.initial, kPosition))
            return false;
        setup_.stage(std::move(setup));
        return true;
    }

    struct Condition {
        bool (*holds)(double number);
        const char* text;
    };

    // Reads one number for all joints, or one for each.
    bool read(const char* name, const std::string& text, std::size_t count, Numbers& numbers,
              const Condition& condition) {
        const Strings found = words(text);
        if (found.size() != 1 && found.size() != count)
            return RTCF_FAIL(this, "{} has {} numbers; write one for all joints, or {}", name,
                             found.size(), count);
        for (std::size_t i = 0; i < count; ++i) {
            const std::string& word = found[found.size() == 1 ? 0 : i];
            const std::optional<double> number = rtcf::readNumber(word);
            if (!number) return RTCF_FAIL(this, "{}: {} is not a number", name, word);
            numbers[i] = *number;
            if (!condition.holds(numbers[i]))
                return RTCF_FAIL(this, "{}: {} is not {}", name, word, condition.text);
        }
        return true;
    }

    bool configure() override {
        const std::size_t count = setup_->joints.size();
        memory_ = std::make_unique<Memory>(count);
        sensor_msgs::JointState state;
        state.name = setup_->joints;
        state.position.resize(count);
        state.velocity.resize(count);
        command.reserve(state);
        trajectory_msgs::JointTrajectoryPoint sample;
        sample.positions.resize(count);
        sample.velocities.resize(count);
        sample.accelerations.resize(count);
        point.reserve(sample);
        trajectory_msgs::JointTrajectory chunk;
        chunk.joint_names = setup_->joints;
        chunk.points.assign(kReservedPoints, sample);
        trajectory.reserve(chunk);
        return true;
    }

    void cleanup() override { memory_.reset(); }

    bool start() override {
        begun_ = false;
        halted_ = false;
        points_id_ = 0;
        rejected_ = 0;
        return true;
    }

    // Continues from the command of a component of another type, or with other joints.
    void takeOver(const rtcf::Predecessor& previous) noexcept override {
        const Task* const task = previous.state<Task>("task");
        if (task != nullptr && task->joints == static_cast<std::int64_t>(count())) return;
        begun_ = false;
        points_id_ = 0;
        const auto* const last = previous.output<sensor_msgs::JointState>("command");
        if (last == nullptr || firstMissing(last->name) < count() ||
            last->position.size() < std::max(last->name.size(), count()))
            return;
        for (std::size_t i = 0; i < count(); ++i) {
            if (!std::isfinite(last->position[memory_->order[i]])) return;
        }
        for (std::size_t i = 0; i < count(); ++i) standAt(i, last->position[memory_->order[i]]);
        beginAtPresent();
    }

    void safe() noexcept override {
        if (!begun_) return;
        for (std::size_t i = 0; i < count(); ++i) {
            if (safe_position == SafePosition::Stop) position_.value()[i] = stopOf(i).end();
            standAt(i, position_.value()[i]);
        }
        points_id_ = 0;
        beginAtPresent();
        write();
    }

    void update() override {
        // Others move the joints: in each cycle, begins again where they are.
        const bool idles = idle.read() != rtcf::DataStatus::None && idle.value();
        if (idles && measured.read() != rtcf::DataStatus::None) begun_ = false;
        // A lost trajectory may have been a stop, or the newest of several.
        const std::uint64_t dropped = trajectory.dropped();
        const bool lost = begun_ && dropped != memory_->dropped.value_or(dropped);
        memory_->dropped = dropped;
        const bool stop = (halt.read() != rtcf::DataStatus::None && halt.value()) || idles;
        if (stop || lost) rejectMessages(stop ? "halted" : "another one was lost in a full queue");
        const std::int64_t last = begun_ ? time_.value() : 0;  // of the present motion
        if (begun_) {
            time_ += std::min(elapsed(), kLongestStep * period());
        } else if (!begin()) {
            rejected.write(rejected_);
            return;
        }
        restore(last);
        adoptLimits(last);
        if ((stop && !halted_) || lost) stopFrom(last);
        halted_ = stop;
        if (target.read() == rtcf::DataStatus::New) follow(target.value(), last);
        // At most one in each cycle: its number of points bounds the work.
        if (const auto* const message = trajectory.front()) {
            follow(*message, last);
            trajectory.pop();
        }
        advance(last);
        write();
    }

    std::size_t count() const noexcept { return setup_->joints.size(); }
    Motion present(std::size_t i) const noexcept {
        return {position_.value()[i], velocity_.value()[i], acceleration_.value()[i]};
    }
    void setPresent(std::size_t i, const Motion& motion) noexcept {
        position_.value()[i] = motion.position;
        velocity_.value()[i] = motion.velocity;
        acceleration_.value()[i] = motion.acceleration;
    }
    StopMotion stopOf(std::size_t i) const noexcept {
        return {present(i), setup_->limits[i], {setup_->lower[i], setup_->upper[i]}};
    }
    void standAt(std::size_t i, double position) noexcept { setPresent(i, {position, 0.0, 0.0}); }
    const Plan& plan() const noexcept { return memory_->plans[memory_->current]; }
    TrajectoryPoints& points() noexcept { return memory_->points; }
    bool followsTrajectory(std::int64_t time) const noexcept {
        return !memory_->points.empty() && time >= memory_->points.begin();
    }

    // Counts and logs a rejected message.
    void reject(const char* what, const char* why) {
        ++rejected_;
        RTCF_WARN_THROTTLE(this, 1.0, "{} rejected: {}", what, why);
    }
    void reject(const char* what, std::size_t joint, const char* why) {
        ++rejected_;
        RTCF_WARN_THROTTLE(this, 1.0, "{} rejected: joint {}: {}", what, setup_->joints[joint],
                           why);
    }
    // Leaves no target and no trajectory that would be followed after the stop.
    void rejectMessages(const char* why) {
        if (target.read() == rtcf::DataStatus::New) reject("target", why);
        for (; trajectory.front() != nullptr; trajectory.pop()) reject("trajectory", why);
    }

    // Finds the index of each joint in a message. Without names, joints have the order of the
    // parameter. Returns the first joint that the message lacks or has twice, or count().
    std::size_t firstMissing(const Strings& names) noexcept {
        auto& order = memory_->order;
        const auto end =
            names.begin() + static_cast<std::ptrdiff_t>(std::min(names.size(), kMostNames));
        for (std::size_t i = 0; i < count(); ++i) {
            order[i] = i;
            if (names.empty()) continue;
            const auto found = std::find(names.begin(), end, setup_->joints[i]);
            if (found == end || std::find(found + 1, end, *found) != end) return i;
            order[i] = static_cast<std::size_t>(found - names.begin());
        }
        return count();
    }
    const char* whyMissing(const Strings& names, std::size_t joint) const noexcept {
        const auto end =
            names.begin() + static_cast<std::ptrdiff_t>(std::min(names.size(), kMostNames));
        return std::find(names.begin(), end, setup_->joints[joint]) == end
                   ? "it is not in the message"
                   : "it is twice in the message";
    }

    // Reads the start position. Returns false if it is not there yet.
    bool begin() {
        const bool has_measured = measured.read() != rtcf::DataStatus::None;
        if (!has_measured) {
            if (!setup_->has_initial) return false;
            for (std::size_t i = 0; i < count(); ++i) standAt(i, setup_->initial[i]);
        } else if (seconds(measured.age(this)) > measurement_timeout) {
            RTCF_WARN_THROTTLE(this, 1.0, "measured is older than measurement_timeout");
            rejectMessages("measured is too old");
            return false;
        } else {
            const sensor_msgs::JointState& state = measured.value();
            const std::size_t missing = firstMissing(state.name);
            for (std::size_t i = 0; i < count(); ++i) {
                const std::size_t at = memory_->order[i];
                if (i == missing || at >= state.position.size() ||
                    !std::isfinite(state.position[at])) {
                    RTCF_WARN_THROTTLE(this, 1.0, "measured: joint {} has no finite position",
                                       setup_->joints[i]);
                    return false;
                }
            }
            for (std::size_t i = 0; i < count(); ++i) standAt(i, state.position[memory_->order[i]]);
        }
        points_id_ = 0;
        beginAtPresent();
        return true;
    }

    // Stands at the present position, at time 0.
    void beginAtPresent() noexcept {
        begun_ = true;
        time_ = 0;
        stopFrom(time_);
    }

    // Makes the plan of a task, in place of the current one if it differs.
    void makePlan() {
        Memory& memory = *memory_;
        Plan& made = memory.plans[memory.current];
        if (made.task != task_.value()) made.make(task_);
    }

    // Stops all joints as fast as possible, from the present motion.
    void stopFrom(std::int64_t time) noexcept {
        Task task;
        task.joints = static_cast<std::int64_t>(count());
        task.begin_ns = time;
        for (std::size_t i = 0; i < count(); ++i) {
            task.setBegin(i, present(i));
            task.setLimits(i, *setup_);
        }
        task_ = task;
        clearPoints();
        makePlan();
    }

    void clearPoints() noexcept {
        points().clear();
        points_id_ = 0;
        memory_->points_id = 0;
    }

    // After a snapshot or in a successor: the plan follows from the state, a trajectory is lost.
    void restore(std::int64_t last) {
        if (points_id_ != memory_->points_id) {
            if (points_id_ != 0) {
                stopFrom(last);
                RTCF_WARN(this, "the rest of the trajectory is lost: stopping");
            }
            clearPoints();
        }
        // State that was set by hand may not fit.
        if (task_->joints != static_cast<std::int64_t>(count())) stopFrom(last);
        makePlan();
    }

    // New limits take effect by a new plan from the present motion.
    void adoptLimits(std::int64_t last) {
        Task task = task_;
        for (std::size_t i = 0; i < count(); ++i) task.setLimits(i, *setup_);
        if (!(task != task_.value())) return;
        if (followsTrajectory(last)) {
            // The task only shows the limits.
            task.kind = Kind::Stop;
            task_ = task;
            makePlan();
            for (std::size_t i = 0; i < count(); ++i) {
                if (!staysAllowed(i, last)) {
                    reject("rest of the trajectory", i, "it exceeds the new limits");
                    stopFrom(last);
                    return;
                }
            }
            return;
        }
        if (!points().empty()) reject("waiting trajectory", "the limits have changed");
        const Task before = task_;
        stopFrom(last);
        if (before.kind != Kind::Target) return;
        task = task_;
        task.kind = Kind::Target;
        for (std::size_t i = 0; i < count(); ++i) {
            const double limit = setup_->limits[i].velocity;
            setTarget(task, i, before.target_position[i],
                      std::clamp(before.target_velocity[i], -limit, limit));
        }
        adopt(task, "target");
    }

    // True if the trajectory under way is within the limits from a time on.
    bool staysAllowed(std::size_t i, std::int64_t time) const {
        const TrajectoryPoints& points = memory_->points;
        const double limit = setup_->limits[i].velocity * (1.0 + kLimitTolerance);
        if (std::abs(velocity_.value()[i]) > limit) return false;
        for (std::size_t k = std::max<std::size_t>(1, points.countBefore(time)); k < points.size();
             ++k) {
            const double duration = seconds(points.time(k) - points.time(k - 1));
            if (violation(i, points.motions(k - 1)[i], points.motions(k)[i], points.kind(k),
                          duration) != nullptr)
                return false;
        }
        return true;
    }

    // A target beyond the limits of position becomes one at the limit, at rest.
    void setTarget(Task& task, std::size_t i, double position, double speed) const {
        const double within = std::clamp(position, setup_->lower[i], setup_->upper[i]);
        task.target_position[i] = within;
        task.target_velocity[i] = within == position ? speed : 0.0;
    }

    // Plans a motion to a target in place of the current one, if it stays within the limits of
    // position, as far as a stop would.
    void adopt(const Task& task, const char* what) {
        Memory& memory = *memory_;
        Plan& next = memory.plans[1 - memory.current];
        if (next.make(task) != PlanError::None) {
            reject(what, "no motion leads there");
            return;
        }
        for (std::size_t i = 0; i < count(); ++i) {
            const PositionRange range = next.range(i);
            PositionRange allowed =
                StopMotion(task.begin(i), task.limits(i), task.allowed(i)).range();
            allowed.add(setup_->lower[i]);
            allowed.add(setup_->upper[i]);
            const double tolerance =
                kLimitTolerance * (1.0 + std::abs(range.lower) + std::abs(range.upper));
            if (range.lower < allowed.lower - tolerance ||
                range.upper > allowed.upper + tolerance) {
                reject(what, i, "the motion would leave the limits of position");
                return;
            }
        }
        memory.current = 1 - memory.current;
        task_ = task;
        clearPoints();
    }

    void follow(const sensor_msgs::JointState& message, std::int64_t last) {
        if (const std::size_t missing = firstMissing(message.name); missing < count()) {
            reject("target", missing, whyMissing(message.name, missing));
            return;
        }
        const std::size_t size = message.name.empty() ? count() : message.name.size();
        if (message.position.size() != size ||
            (!message.velocity.empty() && message.velocity.size() != size)) {
            reject("target", "it needs a position of each joint, and velocities of all or none");
            return;
        }
        Task task;
        task.kind = Kind::Target;
        task.joints = static_cast<std::int64_t>(count());
        task.begin_ns = last;
        bool same = task_->kind == Kind::Target && points().empty();
        for (std::size_t i = 0; i < count(); ++i) {
            const std::size_t at = memory_->order[i];
            const double speed = message.velocity.empty() ? 0.0 : message.velocity[at];
            const MotionLimits& limits = setup_->limits[i];
            if (!std::isfinite(message.position[at]) || !std::isfinite(speed)) {
                reject("target", i, "the target is not finite");
                return;
            }
            if (std::abs(speed) > limits.velocity) {
                reject("target", i, "the velocity at the target is above its limit");
                return;
            }
            task.setBegin(i, withAllowedAcceleration(present(i), limits));
            task.setLimits(i, *setup_);
            setTarget(task, i, message.position[at], speed);
            same = same && task.target_position[i] == task_->target_position[i] &&
                   task.target_velocity[i] == task_->target_velocity[i];
        }
        // A repeated message does not send joints back to a target that they have passed.
        if (!same) adopt(task, "target");
    }

    static PointKind kindOf(const trajectory_msgs::JointTrajectoryPoint& each) {
        if (each.velocities.empty()) return PointKind::Position;
        return each.accelerations.empty() ? PointKind::PositionVelocity
                                          : PointKind::PositionVelocityAcceleration;
    }

    static Motion motionAt(const trajectory_msgs::JointTrajectoryPoint& each, std::size_t index) {
        const PointKind kind = kindOf(each);
        return {each.positions[index], kind == PointKind::Position ? 0.0 : each.velocities[index],
                kind == PointKind::PositionVelocityAcceleration ? each.accelerations[index] : 0.0};
    }

    // The motion in this or a later cycle, without new messages.
    Motion expected(std::size_t i, std::int64_t time) const {
        if (!followsTrajectory(time)) return plan().at(i, time);
        return time < memory_->points.end() ? memory_->points.at(i, time) : memory_->points.last(i);
    }

    // Replaces the tail of the present motion by a trajectory.
    void follow(const trajectory_msgs::JointTrajectory& message, std::int64_t last) {
        constexpr const char* kWhat = "trajectory";
        if (message.points.empty()) {
            stopFrom(last);
            return;
        }
        if (message.points.size() > TrajectoryPoints::kCapacity) {
            reject(kWhat, "it has too many points");
            return;
        }
        if (const std::size_t missing = firstMissing(message.joint_names); missing < count()) {
            reject(kWhat, missing, whyMissing(message.joint_names, missing));
            return;
        }
        const std::size_t size = message.joint_names.empty() ? count() : message.joint_names.size();
        if (size != count()) {
            reject(kWhat, "it has joints that the parameter joints does not have");
            return;
        }
        // Without a stamp, the trajectory begins now. Points of the past do not count.
        const std::int64_t origin =
            message.header.stamp.isZero()
                ? time_
                : time_ + static_cast<std::int64_t>(message.header.stamp.toNSec()) - stamp();
        std::int64_t join = std::max(origin, time_.value());
        if (!points().empty() && join > points().end() && movesAtEnd()) join = points().end();
        const auto timeOf = [&](std::size_t k) {
            return origin + message.points[k].time_from_start.toNSec();
        };
        std::size_t first = 0;
        while (first < message.points.size() && timeOf(first) <= join) ++first;
        if (first == message.points.size()) {
            reject(kWhat, "all points are in the past");
            return;
        }
        if (points().countBefore(join) + 1 + message.points.size() - first >
            TrajectoryPoints::kCapacity) {
            reject(kWhat, "it has too many points");
            return;
        }
        Motions joined;
        for (std::size_t i = 0; i < count(); ++i) joined[i] = expected(i, join);
        std::int64_t before = join;
        Motions from = joined;
        PointKind kind = PointKind::PositionVelocityAcceleration;
        for (std::size_t k = first; k < message.points.size(); before = timeOf(k), ++k) {
            const auto& each = message.points[k];
            if (each.positions.size() != size ||
                (!each.velocities.empty() && each.velocities.size() != size) ||
                (!each.accelerations.empty() && each.accelerations.size() != size)) {
                reject(kWhat, "a point does not have one value of each joint");
                return;
            }
            if (timeOf(k) <= before) {
                reject(kWhat, "the times of the points do not rise");
                return;
            }
            kind = commonKind(kind, kindOf(each));
            for (std::size_t i = 0; i < count(); ++i) {
                const Motion to = motionAt(each, memory_->order[i]);
                if (const char* const why =
                        violation(i, from[i], to, kind, seconds(timeOf(k) - before))) {
                    reject(kWhat, i, why);
                    return;
                }
                from[i] = to;
            }
            kind = kindOf(each);
        }

        const PointKind tail = points().empty() ? PointKind::Position : points().kindAt(join);
        const bool waits = points().empty() || join < points().begin();
        points().truncate(join);
        if (waits) points_begin_ = join;
        std::copy_n(joined.begin(), count(), points().append(join, tail));
        kind = PointKind::PositionVelocityAcceleration;
        for (std::size_t k = first; k < message.points.size(); ++k) {
            const auto& each = message.points[k];
            Motion* const to = points().append(timeOf(k), commonKind(kind, kindOf(each)));
            kind = kindOf(each);
            for (std::size_t i = 0; i < count(); ++i) to[i] = motionAt(each, memory_->order[i]);
        }
        last_id_ += 1;
        last_seq_ = message.header.seq;
        points_id_ = last_id_;
        memory_->points_id = last_id_;
    }

    bool movesAtEnd() const noexcept {
        for (std::size_t i = 0; i < count(); ++i) {
            const Motion& end = memory_->points.last(i);
            if (end.velocity != 0.0 || end.acceleration != 0.0) return true;
        }
        return false;
    }

    // Why a joint cannot get to a point, or null.
    const char* violation(std::size_t i, const Motion& from, const Motion& to, PointKind kind,
                          double duration) const {
        if (!std::isfinite(to.position) || !std::isfinite(to.velocity) ||
            !std::isfinite(to.acceleration))
            return "a point is not finite";
        if (to.position < setup_->lower[i] || to.position > setup_->upper[i])
            return "a point is beyond the limits of position";
        const double limit = setup_->limits[i].velocity * (1.0 + kLimitTolerance);
        if (std::abs(to.velocity) > limit) return "the velocity of a point is above its limit";
        if (std::abs(to.position - from.position) > limit * duration)
            return "a segment needs a velocity above the limit";
        // Where it begins beyond a limit, it has to come back.
        PositionRange positions{setup_->lower[i], setup_->upper[i]};
        positions.add(from.position);
        const double tolerance = kLimitTolerance * (1.0 + std::abs(from.position));
        positions.lower -= tolerance;
        positions.upper += tolerance;
        const double speed = std::max(limit, std::abs(from.velocity) * (1.0 + kLimitTolerance));
        if (!PolynomialSegment(from, to, kind, duration).staysWithin(positions, speed))
            return "a segment exceeds the limits of position or velocity between its points";
        return nullptr;
    }

    // Moves the present motion to that of this cycle.
    void advance(std::int64_t last) {
        if (!followsTrajectory(time_)) {
            for (std::size_t i = 0; i < count(); ++i) setPresent(i, plan().at(i, time_));
            return;
        }
        if (time_ >= points().end()) {
            // Stands at the last point, or stops from there.
            const std::int64_t end = points().end();
            for (std::size_t i = 0; i < count(); ++i) setPresent(i, points().last(i));
            stopFrom(end);
            for (std::size_t i = 0; i < count(); ++i) setPresent(i, plan().at(i, time_));
            return;
        }
        points().forgetBefore(time_);
        for (std::size_t i = 0; i < count(); ++i) {
            const Motion next = points().at(i, time_);
            if (!exceeds(i, next)) continue;
            reject("rest of the trajectory", i, "it exceeds the limits of position or velocity");
            stopFrom(last);
            for (std::size_t j = 0; j < count(); ++j) setPresent(j, plan().at(j, time_));
            return;
        }
        for (std::size_t i = 0; i < count(); ++i) setPresent(i, points().at(i, time_));
    }

    // True if a motion is beyond the limits, and further beyond than the present motion.
    bool exceeds(std::size_t i, const Motion& next) const {
        const double limit = setup_->limits[i].velocity * (1.0 + kLimitTolerance);
        const double low = std::min(setup_->lower[i], position_.value()[i]);
        const double high = std::max(setup_->upper[i], position_.value()[i]);
        const double tolerance = kLimitTolerance * (1.0 + std::abs(next.position));
        return std::abs(next.velocity) > std::max(limit, std::abs(velocity_.value()[i])) ||
               next.position < low - tolerance || next.position > high + tolerance;
    }

    void write() noexcept {
        sensor_msgs::JointState& state = command.value();
        trajectory_msgs::JointTrajectoryPoint& motion = point.value();
        state.header.stamp.fromNSec(static_cast<std::uint64_t>(std::max<std::int64_t>(stamp(), 0)));
        for (std::size_t i = 0; i < count(); ++i) {
            state.position[i] = position_.value()[i];
            state.velocity[i] = velocity_.value()[i];
            motion.positions[i] = position_.value()[i];
            motion.velocities[i] = velocity_.value()[i];
            motion.accelerations[i] = acceleration_.value()[i];
        }
        command.publish();
        point.publish();
        double share = 1.0;
        bool over = points().empty();
        if (!over) {
            const double whole = seconds(points().end() - points_begin_);
            share = seconds(time_ - points_begin_) / whole;
        } else {
            share = plan().progress(time_);
            over = share >= 1.0;
        }
        progress.write(std::clamp(share, 0.0, 1.0));
        done.write(over);
        rejected.write(rejected_);
    }
};

}  // namespace
}  // namespace rtcf_control

RTCF_COMPONENT_NAMED(rtcf_control::TrajectoryGenerator, "TrajectoryGenerator",
                     "Jerk-limited, time-optimal, synchronised motion of 1 to 16 joints to targets "
                     "(Kröger, On-Line Trajectory Generation in Robotic Systems, 2010), and joint "
                     "trajectories of linear, cubic and quintic segments",
                     TrajectoryGenerator)

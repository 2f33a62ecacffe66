#include <mujoco/mujoco.h>
#include <pthread.h>
#include <sensor_msgs/JointState.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <cctype>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include <rtcf/component.hpp>
#include <rtcf/eigen_type.hpp>

namespace rtcf_mujoco {
namespace {

using Vector6 = Eigen::Matrix<double, 6, 1>;

// MuJoCo's handlers are global. Its own ones end the process, and write a file into its folder.
[[noreturn]] void onError(const char* text) { throw std::runtime_error(text); }

// Collects the warnings of its thread. Those of a step, in the real-time thread, are counted in
// mjData::warning. Only one thread loads models.
class Warnings {
   public:
    Warnings() {
        text_.clear();
        thread_ = pthread_self();
    }
    ~Warnings() { thread_ = 0; }
    Warnings(const Warnings&) = delete;
    Warnings& operator=(const Warnings&) = delete;

    static void add(const char* text) {
        if (thread_ == pthread_self()) text_.append(text_.empty() ? "" : " ").append(text);
    }
    const std::string& text() const noexcept { return text_; }

   private:
    static inline std::atomic<pthread_t> thread_{0};
    static inline std::string text_;
};

// A model as configure() loads it, with the data of one simulation.
class Model {
   public:
    /// @throws std::runtime_error with one line, if the file is missing, no valid MJCF, or has NaN,
    /// which MuJoCo takes as a value that is not given
    explicit Model(const std::string& file) {
        const Warnings warnings;
        std::string error(1000, '\0');
        model_.reset(
            mj_loadXML(file.c_str(), nullptr, error.data(), static_cast<int>(error.size())));
        error.resize(error.find('\0'));
        if (model_ == nullptr) throw std::runtime_error(oneLine(error));
        warning_ = oneLine(error + warnings.text());
        if (warning_.find("NaN") != std::string::npos) throw std::runtime_error(warning_);
        data_.reset(mj_makeData(model_.get()));
        if (data_ == nullptr) throw std::runtime_error("no memory for its data");
    }

    /// What MuJoCo warned of while it loaded the model, on one line; empty if nothing
    const std::string& warning() const noexcept { return warning_; }

    mjModel* operator->() const noexcept { return model_.get(); }
    mjModel* get() const noexcept { return model_.get(); }
    mjData& data() const noexcept { return *data_; }

    std::string name(mjtObj type, int id) const {
        const char* const text = mj_id2name(model_.get(), type, id);
        return text == nullptr ? std::string() : text;
    }
    /// @return -1 if there is no such object
    int find(mjtObj type, const std::string& name) const {
        return mj_name2id(model_.get(), type, name.c_str());
    }

   private:
    static std::string oneLine(std::string text) {
        std::replace(text.begin(), text.end(), '\n', ' ');
        text.erase(text.find_last_not_of(" \t") + 1);
        return text;
    }

    struct Delete {
        void operator()(mjModel* model) const { mj_deleteModel(model); }
        void operator()(mjData* data) const { mj_deleteData(data); }
    };
    std::string warning_;
    std::unique_ptr<mjModel, Delete> model_;
    std::unique_ptr<mjData, Delete> data_;
};

// A name of the model as a ROS name; objects without a name are numbered from 1.
std::string portName(const Model& model, mjtObj type, int id, const char* kind) {
    std::string name = model.name(type, id);
    if (name.empty()) return std::string(kind) + "_" + std::to_string(id + 1);
    for (char& c : name) {
        if (std::isalnum(static_cast<unsigned char>(c)) == 0) c = '_';
    }
    if (std::isalpha(static_cast<unsigned char>(name[0])) == 0)
        name.insert(0, std::string(kind) + "_");
    return name;
}

Eigen::Quaterniond quaternion(const mjtNum* wxyz) { return {wxyz[0], wxyz[1], wxyz[2], wxyz[3]}; }

// The ports and the state of a loaded model.
class Plant {
   public:
    /// Declares the model's ports and state as members of `owner`. Not real-time.
    /// @param key a keyframe's number, -1 for the model's own initial state
    Plant(rtcf::Component* owner, Model loaded, int key, int pushed_body)
        : model_(std::move(loaded)),
          pushed_body_(pushed_body),
          longest_step_s_(model_->opt.timestep) {
        mjData& data = model_.data();
        if (key >= 0) mj_resetDataKeyframe(model_.get(), &data, key);
        declarePorts(owner);
        declareState(owner);
    }

    double longestStep() const noexcept { return longest_step_s_; }  ///< the model's time step, s
    double time() const noexcept { return model_.data().time; }      ///< simulated time, s
    std::int32_t contacts() const noexcept { return model_.data().ncon; }  ///< present contacts

    /// A message with the names of hinges and slides, of the size that write() needs.
    sensor_msgs::JointState jointStates() const {
        sensor_msgs::JointState states;
        for (const auto& joint : joints_) states.name.push_back(joint->name);
        states.position.resize(joints_.size());
        states.velocity.resize(joints_.size());
        states.effort.resize(joints_.size());
        return states;
    }

    /// Back to the initial state. Real-time safe.
    void begin() noexcept {
        for (const auto& number : state_) number->state = number->initial;
    }

    /// Adds friction to the joints that have an actuator. Real-time safe.
    /// @param friction N m or N, 0 or above; 0 = released
    void brake(double friction) noexcept {
        for (const Brake& each : brakes_) {
            model_->dof_frictionloss[each.dof] = each.friction + friction;
            std::copy_n(friction > 0.0 ? kHard.begin() : each.impedance.begin(), mjNIMP,
                        model_->dof_solimp + each.dof * mjNIMP);
        }
    }

    /// Advances the simulation by a period. Real-time safe.
    /// @param force force (N) and torque (N m) at the centre of the pushed body, in the world's
    /// axes
    /// @param longest_step_s longest time step, above 0
    /// @throws std::runtime_error if a command is not finite, or the simulation diverges
    void step(const Vector6& force, double period_s, double longest_step_s) {
        mjData& data = model_.data();
        for (const auto& number : state_) *number->place = number->state;
        for (std::size_t i = 0; i < actuators_.size(); ++i) {
            rtcf::Input<double>& command = actuators_[i]->command;
            data.ctrl[i] = command.read() == rtcf::DataStatus::None ? 0.0 : command.value();
            if (!(std::abs(data.ctrl[i]) <= mjMAXVAL))
                throw std::runtime_error("the command " + actuators_[i]->name +
                                         " is not finite, or larger than 1e10");
        }
        if (!force.allFinite()) throw std::runtime_error("the push is not finite");
        std::copy_n(force.data(), 6, data.xfrc_applied + 6 * pushed_body_);

        const double steps =
            std::max(1.0, std::ceil(period_s / longest_step_s * (1.0 - kRounding)));
        model_->opt.timestep = period_s / steps;
        for (int i = 0; i < static_cast<int>(steps); ++i) mj_step(model_.get(), &data);
        for (const mjtWarning wrong : {mjWARN_BADQPOS, mjWARN_BADQVEL, mjWARN_BADQACC}) {
            if (data.warning[wrong].number == 0) continue;
            data.warning[wrong].number = 0;
            throw std::runtime_error(
                "the simulation diverged: its time step is too long, or a force too large");
        }
        for (const auto& number : state_) number->state = *number->place;
    }

    /// Writes the outputs. Real-time safe.
    /// @param turn_counts resolution of hinge joints, 1/turn; 0 = exact
    /// @param states a message of jointStates(); its header stays as it is
    void write(double turn_counts, sensor_msgs::JointState& states) {
        const mjData& data = model_.data();
        for (std::size_t i = 0; i < joints_.size(); ++i) {
            Joint& joint = *joints_[i];
            double position = data.qpos[joint.qpos];
            if (joint.hinge && turn_counts > 0.0)
                position = std::nearbyint(position / kTurn * turn_counts) / turn_counts * kTurn;
            states.position[i] = position;
            states.velocity[i] = data.qvel[joint.dof];
            states.effort[i] = data.qfrc_actuator[joint.dof];
            joint.position.write(states.position[i]);
            joint.velocity.write(states.velocity[i]);
            joint.effort.write(states.effort[i]);
        }
        for (const auto& ball : balls_) {
            ball->orientation.write(quaternion(data.qpos + ball->qpos));
            ball->rate.write(Eigen::Vector3d(data.qvel + ball->dof));
        }
        for (const auto& body : free_) {
            Eigen::Isometry3d pose(quaternion(data.qpos + body->qpos + 3));
            pose.translation() = Eigen::Vector3d(data.qpos + body->qpos);
            body->pose.write(pose);
            body->velocity.write(Eigen::Vector3d(data.qvel + body->dof));
            body->rate.write(Eigen::Vector3d(data.qvel + body->dof + 3));
        }
        for (std::size_t i = 0; i < tendons_.size(); ++i) {
            tendons_[i]->length.write(data.ten_length[i]);
            tendons_[i]->velocity.write(data.ten_velocity[i]);
        }
        for (const auto& each : numbers_) each->value.write(data.sensordata[each->address]);
        for (const auto& each : vectors_)
            each->value.write(Eigen::Vector3d(data.sensordata + each->address));
        for (const auto& each : quaternions_)
            each->value.write(quaternion(data.sensordata + each->address));
    }

   private:
    static constexpr double kRounding = 1e-9;  // relative; no step more for it
    static constexpr double kTurn = 2.0 * M_PI;

    struct Actuator {
        Actuator(rtcf::Component* owner, const std::string& port)
            : name(port), command(owner, port) {}
        std::string name;
        rtcf::Input<double> command;
    };
    // A hinge or a slide.
    struct Joint {
        Joint(rtcf::Component* owner, const std::string& port, bool turns, int q, int v)
            : name(port),
              hinge(turns),
              qpos(q),
              dof(v),
              position(owner, port + "_position", turns ? "rad" : "m", rtcf::Finite()),
              velocity(owner, port + "_velocity", turns ? "rad/s" : "m/s", rtcf::Finite()),
              effort(owner, port + "_effort", turns ? "N m" : "N", rtcf::Finite()) {}
        std::string name;
        bool hinge;
        int qpos;  // index in mjData::qpos
        int dof;   // index in mjData::qvel
        rtcf::Output<double> position;
        rtcf::Output<double> velocity;
        rtcf::Output<double> effort;
    };
    using Impedance = std::array<mjtNum, mjNIMP>;
    // Of a brake: MuJoCo's friction creeps, the less the closer the impedance is to 1.
    static constexpr Impedance kHard{0.9999, 0.9999, 0.001, 0.5, 2.0};

    // A hinge or slide with an actuator, and its friction without the brake.
    struct Brake {
        int dof;
        double friction;
        Impedance impedance;
    };
    struct BallJoint {
        BallJoint(rtcf::Component* owner, const std::string& port, int q, int v)
            : qpos(q),
              dof(v),
              orientation(owner, port + "_orientation"),
              rate(owner, port + "_rate", "rad/s", rtcf::Finite()) {}
        int qpos;
        int dof;
        rtcf::Output<Eigen::Quaterniond> orientation;
        rtcf::Output<Eigen::Vector3d> rate;  // in the axes of the body
    };
    struct FreeJoint {
        FreeJoint(rtcf::Component* owner, const std::string& port, int q, int v)
            : qpos(q),
              dof(v),
              pose(owner, port + "_pose", "m"),
              velocity(owner, port + "_velocity", "m/s", rtcf::Finite()),
              rate(owner, port + "_rate", "rad/s", rtcf::Finite()) {}
        int qpos;
        int dof;
        rtcf::Output<Eigen::Isometry3d> pose;
        rtcf::Output<Eigen::Vector3d> velocity;  // in the axes of the world
        rtcf::Output<Eigen::Vector3d> rate;      // in the axes of the body
    };
    struct Tendon {
        Tendon(rtcf::Component* owner, const std::string& port)
            : length(owner, port + "_length", "m", rtcf::Finite()),
              velocity(owner, port + "_velocity", "m/s", rtcf::Finite()) {}
        rtcf::Output<double> length;
        rtcf::Output<double> velocity;
    };
    template <typename T>
    struct Sensor {
        Sensor(rtcf::Component* owner, const std::string& port, int at)
            : address(at), value(owner, port) {}
        int address;  // index in mjData::sensordata
        rtcf::Output<T> value;
    };
    // A number that the next step depends on, and its place in the model's data.
    struct Number {
        Number(rtcf::Component* owner, const std::string& name, mjtNum* of_data)
            : place(of_data), initial(*of_data), state(owner, name, *of_data) {}
        mjtNum* place;
        double initial;
        rtcf::State<double> state;
    };
    template <typename T>
    using Parts = std::vector<std::unique_ptr<T>>;

    void declarePorts(rtcf::Component* owner) {
        for (int i = 0; i < model_->nu; ++i)
            actuators_.push_back(
                std::make_unique<Actuator>(owner, portName(model_, mjOBJ_ACTUATOR, i, "actuator")));
        for (int i = 0; i < model_->njnt; ++i) {
            const std::string port = jointName(i);
            const int q = model_->jnt_qposadr[i];
            const int v = model_->jnt_dofadr[i];
            switch (model_->jnt_type[i]) {
                case mjJNT_FREE:
                    free_.push_back(std::make_unique<FreeJoint>(owner, port, q, v));
                    break;
                case mjJNT_BALL:
                    balls_.push_back(std::make_unique<BallJoint>(owner, port, q, v));
                    break;
                default:
                    joints_.push_back(std::make_unique<Joint>(
                        owner, port, model_->jnt_type[i] == mjJNT_HINGE, q, v));
            }
        }
        for (int i = 0; i < model_->nu; ++i) {
            const int joint = model_->actuator_trnid[2 * i];
            if (model_->actuator_trntype[i] != mjTRN_JOINT || model_->jnt_type[joint] < mjJNT_SLIDE)
                continue;
            const int dof = model_->jnt_dofadr[joint];
            Brake brake{dof, model_->dof_frictionloss[dof], {}};
            std::copy_n(model_->dof_solimp + dof * mjNIMP, mjNIMP, brake.impedance.begin());
            brakes_.push_back(brake);
        }
        for (int i = 0; i < model_->ntendon; ++i)
            tendons_.push_back(
                std::make_unique<Tendon>(owner, portName(model_, mjOBJ_TENDON, i, "tendon")));
        for (int i = 0; i < model_->nsensor; ++i) {
            const std::string port = portName(model_, mjOBJ_SENSOR, i, "sensor");
            const int at = model_->sensor_adr[i];
            switch (model_->sensor_dim[i]) {
                case 1:
                    addSensor(numbers_, owner, port, at);
                    break;
                case 3:
                    addSensor(vectors_, owner, port, at);
                    break;
                case 4:
                    addSensor(quaternions_, owner, port, at);
                    break;
                default:
                    throw std::runtime_error(fmt::format(
                        "sensor {} has {} values: only those with 1, 3 or 4 have a port type", port,
                        model_->sensor_dim[i]));
            }
        }
    }
    template <typename T>
    static void addSensor(Parts<Sensor<T>>& sensors, rtcf::Component* owner,
                          const std::string& port, int at) {
        sensors.push_back(std::make_unique<Sensor<T>>(owner, port, at));
    }

    void declareState(rtcf::Component* owner) {
        mjData& data = model_.data();
        state_.push_back(std::make_unique<Number>(owner, "clock", &data.time));
        for (int i = 0; i < model_->njnt; ++i) {
            static constexpr int kPositions[] = {7, 4, 1, 1};   // by type
            static constexpr int kVelocities[] = {6, 3, 1, 1};  // by type
            const int type = model_->jnt_type[i];
            const std::string name = jointName(i);
            add(owner, "q_" + name, data.qpos + model_->jnt_qposadr[i], kPositions[type]);
            add(owner, "v_" + name, data.qvel + model_->jnt_dofadr[i], kVelocities[type]);
            // The solver begins with them, so that they decide the last bits.
            add(owner, "a_" + name, data.qacc_warmstart + model_->jnt_dofadr[i], kVelocities[type]);
        }
        for (int i = 0; i < model_->na; ++i)
            add(owner, "activation" + std::to_string(i + 1), data.act + i, 1);
    }
    // One state for each of `count` numbers.
    void add(rtcf::Component* owner, const std::string& name, mjtNum* numbers, int count) {
        for (int i = 0; i < count; ++i) {
            state_.push_back(std::make_unique<Number>(
                owner, count == 1 ? name : name + std::to_string(i + 1), numbers + i));
        }
    }
    std::string jointName(int i) const { return portName(model_, mjOBJ_JOINT, i, "joint"); }

    Model model_;
    int pushed_body_;
    double longest_step_s_;
    Parts<Actuator> actuators_;
    Parts<Joint> joints_;
    std::vector<Brake> brakes_;
    Parts<BallJoint> balls_;
    Parts<FreeJoint> free_;
    Parts<Tendon> tendons_;
    Parts<Sensor<double>> numbers_;
    Parts<Sensor<Eigen::Vector3d>> vectors_;
    Parts<Sensor<Eigen::Quaterniond>> quaternions_;
    Parts<Number> state_;
};

// Steps a model of MuJoCo once in a cycle, by the loop's period: simulated time and loop time
// advance together, however long the cycles take. Everything that the next step depends on is
// declared state, and the model's data are filled from it before each step. So snapshots, replay
// and replacement continue the same motion, bit by bit.
//
// Source of the model: E. Todorov, T. Erez, Y. Tassa, "MuJoCo: A physics engine for model-based
// control", IROS 2012.
class Simulation final : public rtcf::Component {
    static constexpr std::size_t kMostOfRecord = 94;  // bytes of a text in a log record

    rtcf::Parameter<std::string> model{
        this, "model", "", rtcf::Doc("absolute path of an MJCF or URDF file"), rtcf::Fixed()};
    rtcf::Parameter<std::string> keyframe{
        this, "keyframe", "", rtcf::Doc("initial state, a keyframe of the model; empty: its qpos0"),
        rtcf::Fixed()};
    rtcf::Parameter<double> timestep{
        this,           "timestep",      0.0,
        rtcf::Min(0.0), rtcf::Unit("s"), rtcf::Doc("longest time step; 0: the model's")};
    rtcf::Parameter<std::int64_t> encoder_counts{
        this,
        "encoder_counts",
        0,
        rtcf::Min(0),
        rtcf::Max(1'000'000'000),
        rtcf::Unit("1/turn"),
        rtcf::Doc("resolution of the positions of hinge joints; 0: exact")};
    rtcf::Parameter<std::string> pushed_body{
        this, "pushed_body", "", rtcf::Doc("body that push acts on; empty: the model's last one"),
        rtcf::Fixed()};

    rtcf::Parameter<double> brake_friction{
        this,
        "brake_friction",
        0.0,
        rtcf::Min(0.0),
        rtcf::Unit("N m"),
        rtcf::Doc("friction that brake adds to each joint with an actuator; N of slides")};

    rtcf::Input<bool> brake{this, "brake"};
    rtcf::Input<Vector6> push{this, "push"};
    rtcf::Input<bool> reset{this, "reset"};
    rtcf::Output<sensor_msgs::JointState> joint_states{this, "joint_states"};
    rtcf::Output<double> time_of_model{this, "time", "s"};
    rtcf::Output<std::int32_t> contacts{this, "contacts"};

    rtcf::State<bool> was_reset_{this, "was_reset", false, rtcf::Doc("the last value of reset")};

    std::unique_ptr<Plant> plant_;

    bool configure() override {
        const std::string& file = model.value();
        if (file.empty()) return fail("parameter model is missing: the path of an MJCF file");
        if (!std::filesystem::path(file).is_absolute())
            return RTCF_FAIL(this, "parameter model = {} is no absolute path", file);
        mju_user_error = onError;
        mju_user_warning = Warnings::add;
        try {
            Model loaded(file);
            for (std::size_t at = 0; at < loaded.warning().size(); at += kMostOfRecord)
                RTCF_WARN(this, "model {}: {}", file, loaded.warning().substr(at, kMostOfRecord));
            const int key = keyframe.value().empty() ? -1 : loaded.find(mjOBJ_KEY, keyframe);
            if (key < 0 && !keyframe.value().empty())
                return RTCF_FAIL(this, "parameter keyframe = {}: {} has no such keyframe",
                                 keyframe.value(), file);
            const int body = pushed_body.value().empty() ? loaded->nbody - 1
                                                         : loaded.find(mjOBJ_BODY, pushed_body);
            if (body < 0)
                return RTCF_FAIL(this, "parameter pushed_body = {}: {} has no such body",
                                 pushed_body.value(), file);
            plant_ = std::make_unique<Plant>(this, std::move(loaded), key, body);
        } catch (const std::exception& error) {
            return RTCF_FAIL(this, "model {}: {}", file, error.what());
        }
        joint_states.reserve(plant_->jointStates());
        return true;
    }

    void update() override {
        if (reset.read() != rtcf::DataStatus::None) {
            if (reset.value() && !was_reset_) plant_->begin();
            was_reset_ = reset.value();
        }
        move();
    }

    // The plant moves on in the last cycle, with the safe commands of its controllers.
    void safe() noexcept override {
        try {
            move();
        } catch (const std::exception& error) {
            RTCF_ERROR(this, "the last step failed: {}", error.what());
        }
    }

    void move() {
        brake.read();
        plant_->brake(brake.value() ? brake_friction.value() : 0.0);
        const bool pushed = push.read() != rtcf::DataStatus::None;
        plant_->step(pushed ? push.value() : Vector6::Zero().eval(),
                     1e-9 * static_cast<double>(period()),
                     timestep > 0.0 ? timestep.value() : plant_->longestStep());
        sensor_msgs::JointState& states = joint_states.value();
        states.header.stamp.fromNSec(static_cast<std::uint64_t>(stamp()));
        plant_->write(static_cast<double>(encoder_counts.value()), states);
        joint_states.publish();
        time_of_model.write(plant_->time());
        contacts.write(plant_->contacts());
    }
};

}  // namespace
}  // namespace rtcf_mujoco

RTCF_COMPONENT_NAMED(rtcf_mujoco::Simulation, "Simulation",
                     "Simulates an MJCF model with MuJoCo, one period in each cycle", Simulation)

/// @file
/// OROCOS' ports by their names, as RTCF 2021's components use them: a port has
/// a name of its own and no component until it is added to one, in the
/// constructor or in configureHook(). A port that was not added has no peers.
#pragma once

#include <optional>
#include <stdexcept>
#include <string>
#include <utility>

#include "rtcf/component.hpp"

namespace RTT {

/// What a read found; ordered.
enum FlowStatus { NoData = 0, OldData = 1, NewData = 2 };

/// What came of a write.
enum WriteStatus { WriteSuccess = 0, WriteFailure = -1, NotConnected = -2 };

namespace base {

/// What a component knows of a port when it is added.
class PortInterface {
   public:
    explicit PortInterface(std::string name) : name_(std::move(name)) {}
    virtual ~PortInterface() = default;
    PortInterface(const PortInterface&) = delete;
    PortInterface& operator=(const PortInterface&) = delete;

    const std::string& getName() const noexcept { return name_; }
    /// Before the port is added. @return false afterwards: its name is known by then
    bool setName(const std::string& name) {
        if (added()) return false;
        name_ = name;
        return true;
    }
    const std::string& getDescription() const noexcept { return doc_; }
    PortInterface& doc(const std::string& line) {
        doc_ = line;
        return *this;
    }
    /// True if the port has a peer, inside the runner or on ROS. Real-time safe.
    virtual bool connected() const noexcept RTCF_NONBLOCKING = 0;

    /// Makes it a port of `component`. @throws std::logic_error for a name that is taken or not
    /// legal, a port that has been added before, and after configureHook()
    void addTo(::rtcf::Component* component) {
        if (added()) throw std::logic_error("port '" + name_ + "' is added twice");
        declare(component);
    }

   protected:
    virtual bool added() const noexcept = 0;
    virtual void declare(::rtcf::Component* component) = 0;

   private:
    std::string name_;
    std::string doc_;
};

}  // namespace base

/// An input port carrying values of type T.
template <typename T>
class InputPort final : public base::PortInterface {
   public:
    explicit InputPort(const std::string& name = "unnamed") : PortInterface(name) {}

    /// Copies the newest value if there is one; one that was read before only with
    /// `copy_old_data`. Real-time safe for types whose assignment is.
    FlowStatus read(T& sample, bool copy_old_data = true) {
        if (!port_) return NoData;
        switch (port_->read(sample, copy_old_data)) {
            case ::rtcf::DataStatus::New:
                return NewData;
            case ::rtcf::DataStatus::Old:
                return OldData;
            case ::rtcf::DataStatus::None:
                break;
        }
        return NoData;
    }
    /// As read(): an input keeps no more than the newest value.
    FlowStatus readNewest(T& sample, bool copy_old_data = true) {
        return read(sample, copy_old_data);
    }
    bool connected() const noexcept RTCF_NONBLOCKING override {
        return port_ && port_->connected();
    }

   private:
    bool added() const noexcept override { return port_.has_value(); }
    void declare(::rtcf::Component* component) override { port_.emplace(component, getName()); }

    std::optional<::rtcf::Input<T>> port_;
};

/// An output port carrying values of type T.
template <typename T>
class OutputPort final : public base::PortInterface {
   public:
    /// @param keep_last_written_value for source compatibility: it always does
    explicit OutputPort(const std::string& name = "unnamed", bool keep_last_written_value = true)
        : PortInterface(name) {
        (void)keep_last_written_value;
    }

    /// Real-time safe for types whose assignment is; for messages of variable size once
    /// setDataSample() has been given the largest one.
    WriteStatus write(const T& sample) {
        if (!port_) return NotConnected;
        port_->write(sample);
        return port_->connected() ? WriteSuccess : NotConnected;
    }
    /// Takes the capacity of `sample`. For constructor and configureHook(), before or after the
    /// port is added; not real-time safe.
    WriteStatus setDataSample(const T& sample) {
        sample_ = sample;
        if (port_) port_->reserve(sample);
        return WriteSuccess;
    }
    /// The value that was written last, or default-constructed. Real-time safe as copying T is.
    T getLastWrittenValue() { return port_ ? port_->value() : T{}; }
    bool connected() const noexcept RTCF_NONBLOCKING override {
        return port_ && port_->connected();
    }

   private:
    bool added() const noexcept override { return port_.has_value(); }
    void declare(::rtcf::Component* component) override {
        port_.emplace(component, getName());
        if (sample_) port_->reserve(*sample_);
    }

    std::optional<T> sample_;
    std::optional<::rtcf::Output<T>> port_;
};

}  // namespace RTT

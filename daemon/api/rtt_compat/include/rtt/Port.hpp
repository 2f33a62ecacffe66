/// @file
/// OROCOS' ports, as RTCF 2021's components use them: a port has a name of its own and no component
/// until it is added to one, in the constructor or in configureHook(). A port that was not added
/// has no peers.
#pragma once

#include <optional>
#include <stdexcept>
#include <string>
#include <utility>

#include "rtcf/component.hpp"

namespace RTT {

/// Result of a read; ordered.
enum FlowStatus { NoData = 0, OldData = 1, NewData = 2 };

/// Result of a write.
enum WriteStatus { WriteSuccess = 0, WriteFailure = -1, NotConnected = -2 };

namespace base {

/// Base class of all ports.
class PortInterface {
   public:
    explicit PortInterface(std::string name) : name_(std::move(name)) {}
    virtual ~PortInterface() = default;
    PortInterface(const PortInterface&) = delete;
    PortInterface& operator=(const PortInterface&) = delete;

    const std::string& getName() const noexcept { return name_; }
    /// Sets the name. Not real-time safe.
    /// @return false if the port has already been added
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
    /// Hides the peer from the component: from here on an input reads NoData and an output writes
    /// nothing. The connection in the graph stays. Real-time safe.
    void disconnect() noexcept RTCF_NONBLOCKING { disconnected_ = true; }
    /// Clears an input until the next value arrives. Real-time safe.
    virtual void clear() noexcept RTCF_NONBLOCKING = 0;
    /// True if an input has a value that read() has not returned yet. Real-time safe.
    virtual bool hasNewData() const noexcept RTCF_NONBLOCKING { return false; }

    /// Adds the port to `component`. Not real-time safe.
    /// @throws std::logic_error if the name is taken or not legal, if the port was added before,
    /// and after configureHook()
    void addTo(::rtcf::Component* component) {
        if (added()) throw std::logic_error("port '" + name_ + "' is added to two components");
        declare(component);
    }
    /// Takes the place of a port of the same name, which has no peers from here on and must exist
    /// as long as this one. Not real-time safe.
    /// @throws std::logic_error if that has another direction or type, or if this port was added
    /// before
    void replace(PortInterface& earlier) {
        if (added()) throw std::logic_error("port '" + name_ + "' is added to two components");
        if (!takePlaceOf(earlier)) {
            throw std::logic_error("port '" + name_ +
                                   "' is added twice, with different types: rename one");
        }
    }

   protected:
    virtual bool added() const noexcept = 0;
    virtual void declare(::rtcf::Component* component) = 0;
    // Returns false if the other port has another direction or type.
    virtual bool takePlaceOf(PortInterface& earlier) = 0;
    bool disconnected() const noexcept RTCF_NONBLOCKING { return disconnected_; }

   private:
    std::string name_;
    std::string doc_;
    bool disconnected_ = false;
};

class InputPortInterface : public PortInterface {
   public:
    using PortInterface::PortInterface;
};
class OutputPortInterface : public PortInterface {
   public:
    using PortInterface::PortInterface;
};

}  // namespace base

/// An input port carrying values of type T.
template <typename T>
class InputPort final : public base::InputPortInterface {
   public:
    explicit InputPort(const std::string& name = "unnamed") : InputPortInterface(name) {}

    /// Copies the newest value, if any; an old value only with `copy_old_data`. Real-time safe if
    /// the assignment of T is.
    FlowStatus read(T& sample, bool copy_old_data = true) {
        if (!port_ || disconnected()) return NoData;
        const ::rtcf::DataStatus status = port_->read();
        if (status == ::rtcf::DataStatus::New) {
            cleared_ = false;
            sample = port_->value();
            return NewData;
        }
        if (status == ::rtcf::DataStatus::None || cleared_) return NoData;
        if (copy_old_data) sample = port_->value();
        return OldData;
    }
    /// Like read(): an input keeps only the newest value.
    FlowStatus readNewest(T& sample, bool copy_old_data = true) {
        return read(sample, copy_old_data);
    }
    /// Copies the newest value; before the first one, a default-constructed value. Does nothing if
    /// the port was not added, and after disconnect(). Real-time safe if the assignment of T is.
    void getDataSample(T& sample) {
        if (port_ && !disconnected()) sample = port_->value();
    }
    void clear() noexcept RTCF_NONBLOCKING override {
        if (port_) port_->read();
        cleared_ = true;
    }
    bool hasNewData() const noexcept RTCF_NONBLOCKING override {
        return port_ && !disconnected() && port_->isNew();
    }
    bool connected() const noexcept RTCF_NONBLOCKING override {
        return port_ && !disconnected() && port_->connected(component_);
    }

   private:
    bool added() const noexcept override { return port_ != nullptr; }
    void declare(::rtcf::Component* component) override {
        component_ = component;
        port_ = &own_.emplace(component, getName());
    }
    bool takePlaceOf(base::PortInterface& earlier) override {
        auto* const other = dynamic_cast<InputPort*>(&earlier);
        if (other == nullptr) return false;
        component_ = other->component_;
        port_ = std::exchange(other->port_, nullptr);
        return true;
    }

    const ::rtcf::Component* component_ = nullptr;
    std::optional<::rtcf::Input<T>> own_;
    ::rtcf::Input<T>* port_ = nullptr;  // own_, or that of a port that this one has replaced
    bool cleared_ = false;
};

/// An output port carrying values of type T.
template <typename T>
class OutputPort final : public base::OutputPortInterface {
   public:
    /// @param keep_last_written_value ignored: an output always keeps the last value
    explicit OutputPort(const std::string& name = "unnamed", bool keep_last_written_value = true)
        : OutputPortInterface(name) {
        (void)keep_last_written_value;
    }

    /// Writes a value. Real-time safe if the assignment of T is; for messages of variable size,
    /// only up to the size given to setDataSample().
    WriteStatus write(const T& sample) {
        if (!port_ || disconnected()) return NotConnected;
        port_->write(sample);
        return port_->connected() ? WriteSuccess : NotConnected;
    }
    /// Reserves memory for values up to the size of `sample`. In the constructor or
    /// configureHook(), before or after the port is added; not real-time safe.
    WriteStatus setDataSample(const T& sample, bool reset = true) {
        (void)reset;
        sample_ = sample;
        if (port_) port_->reserve(sample);
        return WriteSuccess;
    }
    /// The last written value, or a default-constructed one. Real-time safe if copying T is.
    T getLastWrittenValue() { return port_ ? port_->value() : T{}; }
    /// Copies the last written value. Real-time safe if the assignment of T is.
    /// @return false if the port was not added
    bool getLastWrittenValue(T& sample) {
        if (!port_) return false;
        sample = port_->value();
        return true;
    }
    /// Ignored: an output always keeps the last value.
    void keepLastWrittenValue(bool) noexcept {}
    void keepNextWrittenValue(bool) noexcept {}
    void clear() noexcept RTCF_NONBLOCKING override {}
    bool connected() const noexcept RTCF_NONBLOCKING override {
        return port_ && !disconnected() && port_->connected();
    }

   private:
    bool added() const noexcept override { return port_ != nullptr; }
    void declare(::rtcf::Component* component) override {
        port_ = &own_.emplace(component, getName());
        if (sample_) port_->reserve(*sample_);
    }
    bool takePlaceOf(base::PortInterface& earlier) override {
        auto* const other = dynamic_cast<OutputPort*>(&earlier);
        if (other == nullptr) return false;
        port_ = std::exchange(other->port_, nullptr);
        if (sample_) port_->reserve(*sample_);
        return true;
    }

    std::optional<T> sample_;
    std::optional<::rtcf::Output<T>> own_;
    ::rtcf::Output<T>* port_ = nullptr;  // own_, or that of a port that this one has replaced
};

}  // namespace RTT

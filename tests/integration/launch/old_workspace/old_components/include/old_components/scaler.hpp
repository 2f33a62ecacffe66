#ifndef OLD_COMPONENTS_SCALER_HPP
#define OLD_COMPONENTS_SCALER_HPP

#include <old_msgs/Scaled.h>
#include <std_msgs/Float64.h>

#include <rtcf/macros.hpp>
#include <rtcf/rtcf_extension.hpp>
OROCOS_HEADERS_BEGIN
#include <rtt/InputPort.hpp>
#include <rtt/OutputPort.hpp>
#include <rtt/TaskContext.hpp>
OROCOS_HEADERS_END

namespace old {

// Multiplies its input, and writes the factor, too.
class Scaler : public RTT::TaskContext, public RtcfExtension {
   public:
    explicit Scaler(const std::string& name);
    bool configureHook() override;
    bool startHook() override { return true; }
    void updateHook() override;
    void stopHook() override;
    void cleanupHook() override;

   private:
    RTT::InputPort<std_msgs::Float64> in_;
    RTT::OutputPort<old_msgs::Scaled> out_;
    double factor_ = 1.0;
    old_msgs::Scaled msg_;
};

}  // namespace old

#endif

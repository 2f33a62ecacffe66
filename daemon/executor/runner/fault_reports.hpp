/// @file
/// Unsolicited reports of a runner: faults of the loop and of components, late cycles, and lost
/// messages. Owned by LoopControl; graph thread.
#pragma once

#include <cstdint>
#include <functional>
#include <string>

#include "bridge/size_watch.hpp"
#include "logging/log.hpp"
#include "loop/loop.hpp"
#include "ordering/plan.hpp"
#include "runner/fault_report_limit.hpp"
#include "runner/overrun_report.hpp"
#include "runner/runner_event.hpp"

namespace rtcf::executor {

class FaultReports {
   public:
    /// Publishes the fault text of a component.
    using PublishFault = std::function<void(const std::string& component)>;

    /// @param runner name of the runner, for messages
    FaultReports(const std::string& runner, const Loop& loop, Log& log, ReportEvent report_event,
                 PublishFault publish);

    /// Forgets which faults were reported, before components start again.
    void restart() { recurring_ = {}; }

    /// The event for the fault that has ended the loop. Sets the fault text of its component.
    /// @param max_overruns the limit of the settings
    RunnerEvent endOfLoop(const Graph& graph, std::uint32_t max_overruns) const;
    /// Reports component faults that did not end the loop. A component is taken out once; the
    /// faults that it reports and values that are not finite are reported again after a while.
    void reportComponents(const Graph& graph);
    /// The same for one component.
    void report(Instance& instance);
    /// Reports late cycles, in one line at a time.
    /// @param last true = the loop has ended
    /// @param remark end of the line
    void reportOverruns(const Graph& graph, bool last, const char* remark);
    /// Reports messages lost because of their size.
    /// @param largest present limit, bytes
    void reportLostMessages(const Plan& plan, std::size_t largest);
    /// Number of messages lost because of their size.
    std::uint64_t lostMessages() const noexcept { return sizes_.total(); }

   private:
    const Loop& loop_;
    ReportEvent report_event_;
    PublishFault publish_;
    FaultReportLimit recurring_;
    OverrunReport overruns_;
    SizeWatch sizes_;
    std::int64_t sizes_due_ns_ = 0;
};

}  // namespace rtcf::executor

#include "runner/component_loader.hpp"

#include <fmt/format.h>

#include <utility>

#include "common/error.hpp"

namespace rtcf::executor {

ComponentLoader::ComponentLoader(std::string runner, const Loop& loop, LoopControl& control,
                                 const BridgeLink& bridge, Log& log, FlightRecorder& recorder)
    : runner_(std::move(runner)),
      loop_(loop),
      control_(control),
      bridge_(bridge),
      log_(log),
      recorder_(recorder) {}

std::shared_ptr<Instance> ComponentLoader::make(ComponentDefinition definition,
                                                const std::string& library,
                                                const Progress& progress, bool configure) {
    const std::string full_name = definition.fullName();
    progress("loading " + full_name);
    recorder_.enterLibrary(full_name);
    const std::shared_ptr<const Library> code = libraries_.open(library);
    recorder_.leaveHook();
    requireThreadLocals(*code);
    auto instance = std::make_shared<Instance>(std::move(definition), code, runner_, loop_.clock(),
                                               log_, recorder_, bridge_.hooks());
    if (!configure) {
        instance->freezePorts();
        return instance;
    }
    progress("configuring " + full_name);
    instance->configure();
    return instance;
}

// A rejected library stays loaded, like all libraries; each later request checks it again.
void ComponentLoader::requireThreadLocals(const Library& library) {
    control_.noticeEnd();
    const std::string lacking = loop_.lackingThreadLocals(library.handle());
    if (lacking.empty()) return;
    const bool own = lacking.rfind("/proc/", 0) == 0;  // our copy of the library
    throw Error(
        ErrorKind::LoopRuns,
        fmt::format(
            "library {0}: {1} has thread_local variables, and the loop of {2} started "
            "without memory for them: stop the loop first (rtcfctl -r {2} stop), or load it "
            "before the loop starts",
            library.path(), own ? "it" : lacking + ", which it links against,", runner_));
}

}  // namespace rtcf::executor

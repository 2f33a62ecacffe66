#include "runner/transactions.hpp"

#include <fmt/format.h>

#include <utility>

#include "common/error.hpp"
#include "logging/log_errors.hpp"
#include "names/name_pattern.hpp"
#include "ordering/construction.hpp"

namespace rtcf::executor {

namespace {

// Computes a component's derived values for another period of the loop. Adds them to `values`.
void stagePeriod(Instance& instance, std::int64_t loop_period_ns,
                 std::vector<StagedValue*>& values) {
    bool designed = false;
    for (DerivedBase* derived : accessTo(instance.component()).derived()) {
        designed = derived->propose(loop_period_ns * instance.definition().every) || designed;
    }
    if (!designed) return;
    const std::vector<StagedValue*> staged = instance.stageParameters({});
    values.insert(values.end(), staged.begin(), staged.end());
}

}  // namespace

Transactions::Transactions(std::string runner, const RunnerSettings& settings, const Loop& loop,
                           LoopBoundary& boundary, LoopControl& control, ActivePlan& plan,
                           FrameKeeper& frames, const Publication& publication, BridgeLink& bridge,
                           ComponentLoader& loader, Log& log)
    : runner_(std::move(runner)),
      settings_(settings),
      loop_(loop),
      boundary_(boundary),
      control_(control),
      plan_(plan),
      frames_(frames),
      publication_(publication),
      bridge_(bridge),
      loader_(loader),
      log_(log) {}

MappingFilter Transactions::filter() const {
    return {NamePattern("whitelist", settings_.whitelist),
            NamePattern("blacklist", settings_.blacklist)};
}

void Transactions::requireNoReplay() const {
    if (!replaying_) return;
    throw Error(ErrorKind::ReplayRuns,
                fmt::format("a replay of {0} is under way: wait for its end, or stop it: "
                            "rtcfctl -r {0} stop",
                            runner_));
}

std::vector<std::string> Transactions::adopt(Change change, const Progress& progress) {
    control_.noticeEnd();
    requireNoReplay();
    const Graph graph = change.graph;
    Wiring wiring = wire(graph, filter(), change.origin);
    for (auto& [name, connection] : wiring.connections)
        connection.written = !connection.writer && written_.count(name) != 0;
    checkTaps(wiring);
    Adoption adoption;
    adoption.restoration = change.restoration;
    std::unique_ptr<Plan> plan = buildPlan(graph, std::move(wiring), *plan_, settings_.frequency_hz,
                                           adoption, settings_.bridge);
    adoption.values = change.values;
    adoption.hand_overs = change.hand_overs;
    adoption.copies = change.copies;
    adoption.period_ns = change.period_ns;
    // Frames must not copy values of leaving components, even if a client watches them.
    std::shared_ptr<const FrameTable> frames = framesOf(*plan, adoption);
    if (loop_.running() || control_.state() == RunnerState::Stepping) {
        for (const auto& instance : change.arriving) {
            progress("starting " + instance->fullName());
            instance->start();
        }
    }
    progress("adopting the change");
    boundary_.adopt(adoption);
    if (change.restoration != nullptr && change.restoration->taken_out != nullptr) {
        throw Error(ErrorKind::FailedPrecondition,
                    fmt::format("{} was taken out after a fault: replace it first",
                                change.restoration->taken_out->full_name));
    }
    plan->noteHeld(adoption, *plan_);
    left_.push_back({plan_.replace(std::move(plan)), std::move(change.leaving)});
    frames_.publish(std::move(frames));
    // From here on, an error does not undo the change.
    logErrors(log_, "publishing last values", [&] {
        for (const Leaving& leaving : adoption.leaving) {
            if (!leaving.last_stamp_ns) continue;
            for (FrameTap* tap : leaving.frame_taps) tap->finish(*leaving.last_stamp_ns);
        }
    });
    logErrors(log_, "publishing a change", [&] { adopted(change); });
    for (const auto& instance : left_.back().components) control_.reportFaults(*instance);
    logErrors(log_, "supervising the loop", [this] { control_.noticeEnd(); });
    for (const HandOver& hand_over : adoption.hand_overs) {
        if (!hand_over.skipped) continue;
        change.notes.push_back(fmt::format(
            "{} begins at its initial state: the replaced component was taken out after a fault",
            hand_over.successor->fullName()));
    }
    return std::move(change.notes);
}

void Transactions::cleanUpLeft() noexcept {
    for (Left& left : std::exchange(left_, {})) {
        for (const auto& instance : left.components) {
            instance->stop();
            instance->cleanup();
        }
    }
}

void Transactions::handOver(Change& change, const Instance& previous,
                            const Instance& successor) const {
    HandOver hand_over{&successor.component(), &previous.component(), {}};
    planHandOver(previous.component(), successor.component(), hand_over.states, change.notes);
    std::size_t bytes = bytesOf(hand_over.states);
    for (const HandOver& other : change.hand_overs) bytes += bytesOf(other.states);
    boundary_.requireSmall(bytes, "the state to hand over");
    change.hand_overs.push_back(std::move(hand_over));
}

void Transactions::adopted(const Change& change) {
    if (!change.values.empty()) {
        for (const GraphNode& node : plan_->graph.nodes()) node.instance->releaseStaged();
    }
    written_.clear();
    for (const auto& [name, connection] : plan_->wiring.connections) {
        if (connection.written) written_.insert(name);
    }
    for (const Feed& feed : plan_->schedule.feeds) feed.injector->setBacklogs(feed.backlogs);
    if (control_.simulated()) {
        for (const auto& injector : plan_->bridgeTable().inputs) injector->setQueueing(true);
    }
    control_.publish(change.changed);
    bridge_.setTable(*plan_, *publication_.graph());
}

void Transactions::checkTaps(const Wiring& wiring) const {
    std::size_t taps = 0;
    for (const auto& [name, connection] : wiring.connections)
        taps += connection.published ? 1 + connection.others.size() : 0;
    // If the limit was lowered, existing taps may stay, and their number may shrink.
    const std::size_t present = plan_->serialized_taps.size() + plan_->frame_taps.size();
    if (taps <= most_taps_ || taps <= present) return;
    throw Error(ErrorKind::ResourceExhausted,
                fmt::format("{} published outputs (taps) are more than the {} allowed: reduce the "
                            "whitelist, or raise taps under [limits] in rtcfd's settings",
                            taps, most_taps_));
}

ChangeOutcome Transactions::load(ComponentDefinition definition, const std::string& library,
                                 const Progress& progress) {
    plan_->graph.requireFree(definition.fullName());
    const LoopBreaks breaks = definition.breaks;
    const std::shared_ptr<Instance> instance =
        loader_.make(std::move(definition), library, progress);
    Change change;
    change.graph = plan_->graph;
    change.graph.add({instance, breaks});
    change.origin.loading = instance->fullName();
    change.arriving = {instance};
    adopt(std::move(change), progress);
    return outcomeOf(*instance);
}

ChangeOutcome Transactions::outcomeOf(const Instance& arrived) const {
    ChangeOutcome result = outcomeWith(*plan_, arrived.fullName());
    for (const std::string& remap : arrived.uselessRemaps()) {
        result.notes.push_back(
            fmt::format("remap {} matches no port of {}", remap, arrived.fullName()));
    }
    result.kept = arrived.keptParameters();
    for (const std::string& line : arrived.lostParameters()) result.notes.push_back(line);
    addRemarks(result, {arrived.fullName()});
    return result;
}

void Transactions::addRemarks(ChangeOutcome& outcome,
                              const std::set<std::string>& components) const {
    for (std::string& line : remarks(plan_->graph, plan_->wiring, filter(), components))
        outcome.notes.push_back(std::move(line));
}

ChangeOutcome Transactions::unload(const std::vector<std::string>& names,
                                   const Progress& progress) {
    if (names.empty()) throw Error(ErrorKind::NameMissing, "no component to unload is named");
    Change change;
    change.graph = plan_->graph;
    for (const std::string& name : names) {
        change.leaving.push_back(change.graph.get(name).instance);
        change.graph.remove(name);
    }
    progress("unloading");
    adopt(std::move(change), progress);
    return outcomeWith(*plan_, names.size() == 1 ? names[0] : "");
}

ChangeOutcome Transactions::replace(const std::string& name, ComponentDefinition definition,
                                    const std::string& library, bool reset,
                                    const Progress& progress) {
    const GraphNode old = plan_->graph.get(name);
    if (definition.fullName() != name) plan_->graph.requireFree(definition.fullName());
    if (!reset) {
        const auto& declared = accessTo(old.instance->component()).parameters();
        for (std::size_t i = 0; i < declared.size(); ++i) {
            const ParameterDeclaration& declaration = declared[i]->declaration();
            const ParameterValue& value = old.instance->parameterValues()[i];
            definition.inherited.push_back(
                {declaration.name, value, !sameValue(value, declaration.default_value)});
        }
    }
    const LoopBreaks breaks = definition.breaks;
    const std::shared_ptr<Instance> instance =
        loader_.make(std::move(definition), library, progress);
    Change change;
    change.graph = plan_->graph;
    change.graph.replace(name, {instance, breaks});
    change.origin.loading = instance->fullName();
    change.arriving = {instance};
    change.leaving = {old.instance};
    handOver(change, *old.instance, *instance);
    std::vector<std::string> notes = adopt(std::move(change), progress);
    ChangeOutcome result = outcomeOf(*instance);
    result.notes.insert(result.notes.end(), notes.begin(), notes.end());
    return result;
}

ChangeOutcome Transactions::apply(const std::vector<WantedComponent>& wanted, bool dry_run,
                                  const Progress& progress) {
    std::vector<Difference> differences = compare(plan_->graph, wanted);
    std::vector<std::pair<std::shared_ptr<Instance>, std::vector<ParameterValue>>> previous;
    for (const GraphNode& node : plan_->graph.nodes()) {
        previous.emplace_back(node.instance, node.instance->parameterValues());
    }
    const auto restoreParameters = [&] {
        for (auto& [instance, values] : previous) instance->restoreParameterValues(values);
    };
    std::vector<std::string> notes;
    try {
        Change change;
        change.graph = plan_->graph;
        change.origin.applied = true;
        const auto made = makeComponents(differences, progress, dry_run);
        for (std::size_t i = 0; i < differences.size(); ++i)
            addDifference(change, differences[i], made[i]);
        if (dry_run) {
            (void)wire(change.graph, filter(), change.origin);
            restoreParameters();
        } else if (!differences.empty()) {
            notes = adopt(std::move(change), progress);
        }
    } catch (...) {
        restoreParameters();
        throw;
    }
    ChangeOutcome result = outcomeWith(*plan_);
    result.notes = std::move(notes);
    result.differences = std::move(differences);
    std::set<std::string> changed;
    for (Difference& difference : result.differences) {
        difference.wanted = nullptr;
        changed.insert(difference.component);
    }
    if (!dry_run) addRemarks(result, changed);
    return result;
}

std::vector<std::shared_ptr<Instance>> Transactions::makeComponents(
    const std::vector<Difference>& differences, const Progress& progress, bool look) {
    std::vector<std::size_t> loading;
    std::vector<const WantedComponent*> wanted;
    for (std::size_t i = 0; i < differences.size(); ++i) {
        const Difference::Kind kind = differences[i].kind;
        if (kind != Difference::Kind::Load && kind != Difference::Kind::Replace) continue;
        loading.push_back(i);
        wanted.push_back(differences[i].wanted);
    }
    std::vector<std::shared_ptr<Instance>> made(differences.size());
    for (const std::size_t next : constructionOrder(wanted)) {
        made[loading[next]] =
            loader_.make(wanted[next]->definition, wanted[next]->library, progress, !look);
    }
    return made;
}

void Transactions::addDifference(Change& change, const Difference& difference,
                                 const std::shared_ptr<Instance>& made) {
    const std::string& name = difference.component;
    switch (difference.kind) {
        case Difference::Kind::Unload:
            change.leaving.push_back(change.graph.get(name).instance);
            change.graph.remove(name);
            return;
        case Difference::Kind::Breaks:
            change.graph.setBreaks(name, difference.wanted->definition.breaks);
            return;
        case Difference::Kind::Parameters: {
            const auto staged =
                change.graph.get(name).instance->stageParameters(difference.parameters);
            change.values.insert(change.values.end(), staged.begin(), staged.end());
            change.changed.insert(name);
            return;
        }
        case Difference::Kind::Load:
        case Difference::Kind::Replace:
            break;
    }
    const ComponentDefinition& definition = difference.wanted->definition;
    change.arriving.push_back(made);
    if (difference.kind == Difference::Kind::Load) {
        change.graph.add({made, definition.breaks});
        return;
    }
    const std::shared_ptr<Instance> old = change.graph.get(name).instance;
    change.graph.replace(name, {made, definition.breaks});
    change.leaving.push_back(old);
    handOver(change, *old, *made);
}

void Transactions::renewComponents(const Progress& progress) {
    Change renewed;
    Change previous;
    previous.graph = plan_->graph;
    for (const GraphNode& node : plan_->graph.nodes()) {
        const Instance& old = *node.instance;
        ComponentDefinition definition = old.definition();
        definition.parameters.clear();
        const auto& parameters = accessTo(old.component()).parameters();
        for (std::size_t i = 0; i < parameters.size(); ++i) {
            definition.parameters.emplace_back(parameters[i]->declaration().name,
                                               old.parameterValues()[i]);
        }
        auto instance = loader_.make(std::move(definition), old.library().path(), progress);
        if (old.hasPhase()) instance->setPhase(old.phase());
        renewed.graph.add({instance, node.breaks});
        renewed.leaving.push_back(node.instance);
    }
    adopt({}, progress);  // removes all values of connections
    try {
        adopt(std::move(renewed), progress);
    } catch (...) {
        adopt(std::move(previous), progress);
        throw;
    }
}

void Transactions::applySettings(std::int64_t period_ns) {
    Change change;
    change.graph = plan_->graph;
    change.period_ns = period_ns;
    try {
        if (period_ns != 0) {
            for (const GraphNode& node : change.graph.nodes())
                stagePeriod(*node.instance, period_ns, change.values);
        }
        adopt(std::move(change), [](const std::string&) {});
    } catch (...) {
        for (const GraphNode& node : plan_->graph.nodes()) node.instance->releaseStaged();
        throw;
    }
}

void Transactions::makeWritable(const std::string& topic) {
    written_.insert(topic);
    Change change;
    change.graph = plan_->graph;
    try {
        adopt(std::move(change), [](const std::string&) {});
    } catch (...) {
        written_.erase(topic);
        throw;
    }
}

void Transactions::watch(std::uint64_t watch, Watch wanted, bool allow_missing) {
    if (!allow_missing) requireMatches(wanted.selection, *plan_);
    frames_.add(watch, std::move(wanted));
    try {
        adoptFrames();
    } catch (...) {
        frames_.remove(watch);
        throw;
    }
}

void Transactions::endWatch(std::uint64_t watch) {
    if (frames_.remove(watch)) adoptFrames();
}

std::shared_ptr<const FrameTable> Transactions::framesOf(const Plan& plan, Adoption& adoption) {
    return frames_.prepare(plan, settings_.frequency_hz, settings_.frame_bytes, adoption);
}

void Transactions::adoptFrames() {
    control_.noticeEnd();
    Adoption adoption;
    std::shared_ptr<const FrameTable> frames = framesOf(*plan_, adoption);
    boundary_.adopt(adoption);
    frames_.publish(std::move(frames));
}

ChangeOutcome Transactions::setBreaks(const std::vector<std::pair<std::string, std::string>>& ports,
                                      bool broken) {
    if (ports.empty()) throw Error(ErrorKind::NameMissing, "no input is named");
    Change change;
    change.graph = plan_->graph;
    for (const auto& [component, port] : ports) change.graph.setBreak(component, port, broken);
    adopt(std::move(change), [](const std::string&) {});
    return outcomeWith(*plan_, ports[0].first);
}

}  // namespace rtcf::executor

#include "loop/cycle.hpp"

#include <algorithm>
#include <cstring>
#include <exception>
#include <set>
#include <utility>

#include "common/thrown.hpp"

namespace rtcf::executor {

namespace {

// Replaces a component's device statistics for one update, unless `statistics` is null.
class DeviceLoan {
   public:
    DeviceLoan(ComponentContext& context, DeviceStatistics* statistics) noexcept
        : context_(context), own_(context.device) {
        if (statistics != nullptr) context.device = statistics;
    }
    ~DeviceLoan() { context_.device = own_; }
    DeviceLoan(const DeviceLoan&) = delete;
    DeviceLoan& operator=(const DeviceLoan&) = delete;

   private:
    ComponentContext& context_;
    DeviceStatistics* own_;
};

}  // namespace

Cycle::Cycle(FlightRecorder& recorder) : Cycle(recorder, std::make_shared<Attention>()) {}

Cycle::Cycle(FlightRecorder& recorder, std::shared_ptr<Attention> attention)
    : schedule_(&empty_),
      frames_(&no_frames_),
      attention_(*attention),
      notes_(recorder.realtimeNotes()),
      shared_attention_(std::move(attention)),
      boundary_(attention_),
      counter_(CycleCounter::calibrate()),
      no_frames_({}, 0, FrameRing::kFewestFrames, counter_) {
    statistics_.adoption.allocate();
    statistics_.wake_up.allocate();
}

void Cycle::announce(Pace pace) {
    setClock(pace);
    // Messages of components from before the start; those of its hooks come afterwards.
    for (QueueBase* queue : schedule_->queues) {
        queue->noteDropped(queue->size());
        queue->clear();
        queue->skip();
    }
}

void Cycle::setClock(Pace pace) {
    const bool monotonic = pace == Pace::RealTime;
    const std::int64_t time_ns = monotonic ? monotonicNow() : 0;
    // The time between two loops counts only if one clock has measured it.
    const bool measured = monotonic && monotonic_ && time_ns >= clock_.time_ns;
    if (!measured && time_ns != clock_.time_ns) moveTime(time_ns - clock_.time_ns);
    monotonic_ = monotonic;
    clock_.iteration = 0;
    clock_.time_ns = time_ns;
    clock_.stamp_ns = monotonic ? time_ns + stamp_offset_ns_.load(std::memory_order_relaxed) : 0;
}

void Cycle::begin(std::int64_t period_ns, std::uint64_t warmup_cycles, Pace pace) {
    setClock(pace);
    if (pace != Pace::Steps) takeOld();
    clock_.period_ns = period_ns;
    clock_.elapsed_ns = period_ns;
    total_elapsed_ns_ = 0;
    warmup_cycles_ = warmup_cycles;
    for (const Step& step : schedule_->steps) {
        ComponentContext& context = accessTo(*step.component).context();
        context.period_ns = period_ns * step.every;
        context.updated_ns = -1;
        context.disabled = false;
        schedule_->turnOf(step).statistics->faults.clear();
    }
    noteWork();
    // Hooks may have written outputs since the last cycle.
    frames_->setBase();
    statistics_.iteration.store(0, std::memory_order_relaxed);
    fault_ = {};
    active_ = true;
}

// Values from outside that arrived before the start are old: they keep their true age, and queues
// drop them.
void Cycle::takeOld() {
    const std::int64_t now = monotonicNow();
    for (const Feed& feed : schedule_->feeds) {
        Injector& injector = *feed.injector;
        injector.deliverUntil(now, 0.0);  // waiting for a simulated clock
        const bool fresh = injector.adopt(clock_);
        injector.setAge(now - injector.arrived(), clock_.time_ns);
        for (InputPort* input : feed.readers) {
            if (fresh || &input->slot() == injector.front()) input->injectOld(injector.front());
        }
        std::uint64_t dropped = 0;  // a message may be in several queues
        for (const auto& backlog : feed.backlogs) dropped = std::max(dropped, backlog->dropOld());
        injector.noteDropped(dropped);
    }
}

// Stamps must be earlier than the next cycle, so that its writes are new to each reader.
void Cycle::moveTime(std::int64_t by_ns) {
    std::set<const SlotHeader*> moved;  // several inputs may read one slot
    const auto move = [&](const SlotHeader* slot) {
        // An input that never had a writer reads a constant.
        if (slot->stamp == 0 || !moved.insert(slot).second) return;
        const_cast<SlotHeader*>(slot)->stamp = movedStamp(slot->stamp, by_ns);
    };
    for (const Step& step : schedule_->steps) {
        accessTo(*step.component)
            .setTime(std::max<std::int64_t>(1, step.component->time() + by_ns));
        for (OutputPort* output : accessTo(*step.component).outputs()) {
            output->moveDraft(by_ns);
            move(output->slot().get());
            move(output->written());
        }
        for (InputPort* input : accessTo(*step.component).inputs()) {
            move(&input->slot());
            input->moveTime(by_ns);
            if (QueueBase* const queue = input->queue()) queue->moveTime(by_ns);
        }
    }
    for (const Latch& latch : schedule_->latches) move(latch.to);
    for (const Feed& feed : schedule_->feeds) move(feed.injector->front());
    for (SerializedTap* tap : schedule_->serialized_taps) tap->moveTime(by_ns);
    for (FrameTap* tap : schedule_->frame_taps) tap->moveTime(by_ns);
}

// The only place that catches exceptions of components. `Plain` leaves out features that most
// components do not use, so that they cost those nothing.
// @param ended frame's words for the ends of these steps
// @return false if a fault ended the loop
template <bool Plain>
[[gnu::always_inline]] inline bool Cycle::update(const Step* next, const Step* end,
                                                 FrameRing::Word* ended) noexcept {
    const FlightRecorder::RealtimeNotes notes = notes_;
    const std::int64_t time = clock_.time_ns;
    while (true) {
        bool goes_on = false;
        try {
            for (; next != end; ++next, ++ended) {
                if (!Plain) {
                    connectWaiting(*next);
                    if (!due(*next)) {
                        ended->store(0, std::memory_order_release);
                        continue;
                    }
                }
                notes.enterComponent(next->slot);
                Component& component = *next->component;
                accessTo(component).setTime(time);
                if (Plain) {
                    next->update(&component);
                } else {
                    const DeviceLoan loan(accessTo(component).context(),
                                          counted_ ? nullptr : &uncounted_);
                    component.update();
                    commit(component, *schedule_->turnOf(*next).statistics, OnBadOutput::End);
                }
                noteCycleCounter(*ended);
            }
            return true;
        } catch (const std::exception& error) {
            goes_on = threw(*next, textOf(error));
        } catch (...) {
            goes_on = threw(*next, "an exception of unknown type");
        }
        if (Plain || !goes_on) {
            leaveOut(next, ended);
            return false;
        }
        noteCycleCounter(*ended);
        ++next;
        ++ended;
    }
}

// Completes the frame, and with it the cycle.
[[gnu::always_inline]] inline void Cycle::finish() noexcept RTCF_NONBLOCKING {
    FrameRing& frames = *frames_;
    frames.take();
    frames.commit(readCycleCounter());
    const std::uint64_t next = clock_.iteration + 1;
    clock_.iteration = next;
    statistics_.iteration.store(next, std::memory_order_relaxed);
}

bool Cycle::run(std::int64_t time_ns, std::int64_t latency_ns) noexcept RTCF_NONBLOCKING {
    const std::int64_t begin = readCycleCounter();
    if (attention_.work() != 0) return runSpecial(begin, time_ns, latency_ns);
    setTimes(time_ns);
    notes_.setIteration(clock_.iteration);
    FrameRing::Word* const ended =
        frames_->begin({clock_.iteration, clock_.stamp_ns, latency_ns, begin, begin});
    const std::vector<Step>& steps = schedule_->steps;
    update<true>(steps.data(), steps.data() + steps.size(), ended);
    notes_.leaveComponents();
    finish();
    return true;
}

// A cycle with any work besides its components.
[[gnu::noinline]] bool Cycle::runSpecial(std::int64_t begin_ticks, std::int64_t time_ns,
                                         std::int64_t latency_ns) noexcept {
    constexpr unsigned kBefore = Attention::kExchange | Attention::kBoundary | Attention::kArrived;
    constexpr unsigned kNotPlain = Attention::kWarmUp | Attention::kWaiting | Attention::kSelective;
    std::int64_t ready = begin_ticks;
    if ((attention_.work() & kBefore) != 0) {
        if (!exchange(time_ns)) return false;  // the inputs' values are undefined
        ready = readCycleCounter();  // the exchange is not part of any component's duration
    }
    const unsigned work = attention_.work();  // a change may have set it
    setTimes(time_ns);
    notes_.setIteration(clock_.iteration);
    counted_ = (work & Attention::kWarmUp) == 0;
    FrameRing::Word* const ended = frames_->begin(
        {clock_.iteration, clock_.stamp_ns, latency_ns, begin_ticks, ready,
         counted_ ? FrameKind::Counted : FrameKind::WarmUp, std::exchange(restored_, false)});
    const std::vector<Step>& steps = schedule_->steps;
    const bool completed = (work & kNotPlain) != 0
                               ? updateSelective(work, ended)
                               : update<true>(steps.data(), steps.data() + steps.size(), ended);
    notes_.leaveComponents();
    if ((work & Attention::kExchange) != 0 && completed) {
        for (QueueBase* queue : schedule_->queues) queue->receive();
        for (SerializedTap* tap : schedule_->serialized_taps) tap->push(clock_.stamp_ns);
        given_ticks_ = readCycleCounter();
    }
    finish();
    if ((work & (Attention::kWarmUp | Attention::kWaiting)) != 0) noteWork();
    return true;
}

// Runs the work before the components: a change at the boundary, values from outside, and values of
// the previous cycle.
// @return false if a fault ended the loop
bool Cycle::exchange(std::int64_t time_ns) noexcept {
    if (boundary_.waiting()) {
        // The elapsed time of this cycle is measured in the period before the change.
        const std::int64_t elapsed = clock_.elapsed_ns;
        atBoundary(time_ns);
        clock_.elapsed_ns = elapsed;
        if (faulted()) return false;
    }
    setTimes(time_ns);
    feed();
    return copyLatches();
}

// Runs steps of which some are not plain, or none is, because statistics of devices do not count
// yet, or inputs wait for their writers.
// @param work  of the cycle
// @param ended frame's words for the ends of the steps
// @return false if a fault ended the loop
[[gnu::noinline]] bool Cycle::updateSelective(unsigned work, FrameRing::Word* ended) noexcept {
    next_waiting_ = 0;
    if ((work & Attention::kSelective) != 0) total_elapsed_ns_ += clock_.elapsed_ns;
    const Step* const first = schedule_->steps.data();
    if ((work & (Attention::kWarmUp | Attention::kWaiting)) != 0) {
        const bool completed = updateSelected(first, first + schedule_->steps.size(), ended);
        dropConnected();
        return completed;
    }
    for (const auto& [begin, end, plain] : schedule_->stretches) {
        FrameRing::Word* const at = ended + (begin - first);
        if (!(plain ? update<true>(begin, end, at) : updateSelected(begin, end, at))) return false;
    }
    return true;
}

// Runs steps that are not plain. A separate function, as it needs registers that plain steps do
// not.
[[gnu::noinline]] bool Cycle::updateSelected(const Step* next, const Step* end,
                                             FrameRing::Word* ended) noexcept {
    return update<false>(next, end, ended);
}

// Notes in the frame that this step and those after it did not run.
[[gnu::noinline]] void Cycle::leaveOut(const Step* next, FrameRing::Word* ended) noexcept
    RTCF_NONBLOCKING {
    const std::vector<Step>& steps = schedule_->steps;
    for (const Step* const end = steps.data() + steps.size(); next != end; ++next, ++ended)
        ended->store(0, std::memory_order_release);
}

// True if a component runs in this cycle; also sets its elapsed time.
bool Cycle::due(const Step& step) const noexcept RTCF_NONBLOCKING {
    ComponentContext& context = accessTo(*step.component).context();
    if (context.disabled) return false;
    if (step.every == 1) return true;
    if (clock_.iteration % step.every != schedule_->turnOf(step).phase) return false;
    context.elapsed_ns = context.updated_ns >= 0
                             ? total_elapsed_ns_ - context.updated_ns
                             : std::max<std::int64_t>(clock_.elapsed_ns, context.period_ns);
    context.updated_ns = total_elapsed_ns_;
    return true;
}

// Connects the inputs of a component whose new writers have written.
void Cycle::connectWaiting(const Step& step) noexcept RTCF_NONBLOCKING {
    for (; next_waiting_ < waiting_.size() && waiting_[next_waiting_].step <= &step;
         ++next_waiting_)
        waiting_[next_waiting_].input->connectWritten();
}

void Cycle::dropConnected() noexcept {
    waiting_.erase(std::remove_if(waiting_.begin(), waiting_.end(),
                                  [](const Waiting& each) { return !each.input->waiting(); }),
                   waiting_.end());
}

// Publishes a component's staged outputs. @throws any exception of a copy
void Cycle::commit(Component& component, ComponentStatistics& statistics, OnBadOutput may) {
    for (OutputPort* output : accessTo(component).stagedOutputs()) {
        if (output->commit()) continue;
        if (output->nonFinitePolicy() == OnNonFinite::Stop && may == OnBadOutput::End &&
            !faulted()) {
            endLoop(LoopFault::Kind::NotFinite, &component, output->name().c_str());
            continue;
        }
        statistics.faults.not_finite.note(clock_.iteration, output->name().c_str());
        statistics.faults.count.add(1);
    }
}

// @return true if the cycle goes on with the next component
bool Cycle::threw(const Step& step, const char* text) noexcept {
    const Turn& turn = schedule_->turnOf(step);
    accessTo(*step.component).context().disabled = true;
    putBack(step);
    if (!turn.optional) {
        endLoop(LoopFault::Kind::Exception, step.component, text);
        return false;
    }
    turn.statistics->faults.taken_out.noteCopy(clock_.iteration, text);
    turn.statistics->faults.count.add(1);
    // If a commit threw, outputs committed before it already have the stamp of this cycle.
    accessTo(*step.component).setTime(clock_.time_ns + 1);
    makeSafe(*step.component, *turn.statistics, OnBadOutput::End);
    return true;
}

void Cycle::endLoop(LoopFault::Kind kind, const Component* component, const char* text) noexcept {
    fault_.kind = kind;
    fault_.component = component;
    if (component != nullptr) {
        std::strncpy(fault_.component_name.data(), component->fullName().c_str(),
                     fault_.component_name.size() - 1);
    }
    fault_.iteration = clock_.iteration;
    std::strncpy(fault_.text.data(), text, fault_.text.size() - 1);
}

void Cycle::makeSafe(Component& component, ComponentStatistics& statistics,
                     OnBadOutput may) noexcept {
    {
        const RealtimeHookNote note(notes_, accessTo(component).context().recorder_slot,
                                    Hook::Safe);
        component.safe();
    }
    const auto keepBefore = [&](const char* text) {
        statistics.faults.unsafe.noteCopy(clock_.iteration, text);
        statistics.faults.count.add(1);
    };
    try {
        commit(component, statistics, may);
    } catch (const std::exception& error) {
        keepBefore(textOf(error));
    } catch (...) {
        keepBefore("an exception of unknown type");
    }
}

// Restores the outputs of a component that threw, so that neither readers nor its own safe() see
// half-written values.
void Cycle::putBack(const Step& step) noexcept {
    for (OutputPort* output : accessTo(*step.component).outputs()) {
        output->dropDraft();
        if (!output->staged()) {
            frames_->putBack(output->slot().get());
            continue;
        }
        try {
            output->takeBack();
        } catch (...) {
            output->discard();  // no memory for the component's copy; readers have theirs
        }
    }
}

bool Cycle::copy(const Latch& latch) noexcept {
    try {
        latch.copy();
        return true;
    } catch (...) {
        if (active_ && !faulted())
            endLoop(LoopFault::Kind::NoMemory, latch.writer,
                    "an output that is read one cycle late");
        return false;
    }
}

bool Cycle::copyLatches() noexcept {
    bool copied = true;
    for (const Latch& latch : schedule_->latches) copied = copy(latch) && copied;
    return copied;
}

// In schedule order, so that a driver's safe() reads the output of its controller's safe().
void Cycle::makeSafe(std::int64_t time_ns) noexcept {
    if (!active_) return;
    active_ = false;  // from here on, a fault does not end the loop again
    setTimes(time_ns);
    notes_.setIteration(clock_.iteration);
    feed();
    copyLatches();
    next_waiting_ = 0;
    for (const Step& step : schedule_->steps) {
        connectWaiting(step);
        accessTo(*step.component).setTime(time_ns);
        // safe() of a component that was taken out has already run.
        const Turn& turn = schedule_->turnOf(step);
        if (turn.optional && accessTo(*step.component).context().disabled) continue;
        makeSafe(*step.component, *turn.statistics, OnBadOutput::GoOn);
    }
    dropConnected();
    for (SerializedTap* tap : schedule_->serialized_taps) tap->push(clock_.stamp_ns);
    leaveOut(schedule_->steps.data(),
             frames_->begin({clock_.iteration, clock_.stamp_ns, 0, 0, 0, FrameKind::LastOfLoop,
                             std::exchange(restored_, false)}));
    frames_->take();
    frames_->commit(0);
    settle();
}

void Cycle::noteWork() noexcept RTCF_NONBLOCKING {
    const Schedule& schedule = *schedule_;
    unsigned work = 0;
    if (!schedule.latches.empty() || !schedule.queues.empty() || !schedule.serialized_taps.empty())
        work |= Attention::kExchange;
    if (schedule.selective) work |= Attention::kSelective;
    if (clock_.iteration < warmup_cycles_) work |= Attention::kWarmUp;
    if (!waiting_.empty()) work |= Attention::kWaiting;
    attention_.setLasting(work);
}

void Cycle::feed() noexcept RTCF_NONBLOCKING {
    if ((attention_.work() & Attention::kArrived) == 0) return;
    attention_.take(Attention::kArrived);
    for (const Feed& feed : schedule_->feeds) {
        Injector& injector = *feed.injector;
        if (!injector.adopt(clock_)) continue;
        for (const auto& backlog : feed.backlogs) backlog->enter(clock_.time_ns);
        for (InputPort* input : feed.readers) {
            if (injector.isOld()) {
                input->injectOld(injector.front());
            } else {
                input->inject(injector.front());
            }
        }
        for (const auto& backlog : feed.backlogs) backlog->queue().skip();
    }
}

void Cycle::blame(std::int64_t limit_ticks) noexcept RTCF_NONBLOCKING {
    const CycleTicks ticks = frames_->lastTicks();
    if (ticks.ready > limit_ticks) {
        statistics_.exchange_overruns.add(1);
        return;
    }
    const FrameRing::Word* ended = frames_->lastEnded();
    for (const Step& step : schedule_->steps) {
        if (static_cast<std::int64_t>((ended++)->load(std::memory_order_relaxed)) <= limit_ticks)
            continue;  // did not run, or ended in time
        schedule_->turnOf(step).statistics->overruns.add(1);
        return;
    }
    // All components ended in time: frames or exchange caused the overrun.
    const bool given = given_ticks_ >= ticks.begin;
    (given && given_ticks_ > limit_ticks ? statistics_.exchange_overruns
                                         : statistics_.frame_overruns)
        .add(1);
}

}  // namespace rtcf::executor

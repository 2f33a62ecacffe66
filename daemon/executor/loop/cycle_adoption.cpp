// The work of a cycle boundary: Cycle::apply() and Cycle::capture().

#include "loop/adoption.hpp"

#include <algorithm>

#include "loop/cycle.hpp"

namespace rtcf::executor {

void Cycle::apply(Adoption& adoption) noexcept {
    const std::int64_t begin = readCycleCounter();
    if (adoption.restoration != nullptr && !restore(*adoption.restoration)) return;
    for (const StateCopy& state : adoption.copies) state.copy();
    for (const Latch& latch : adoption.new_latches) copy(latch);
    changeComponents(adoption);
    for (const Audience& audience : adoption.audiences)
        audience.output->setConnected(audience.present);
    for (StagedValue* value : adoption.values) value->commit();
    if (adoption.frames != nullptr) frames_ = adoption.frames;
    if (adoption.schedule != nullptr) {
        schedule_ = adoption.schedule;
        waiting_.swap(adoption.waiting);
        dropConnected();
        // There may be messages for its new feeds.
        attention_.request(Attention::kArrived);
    }
    noteWork();
    if (adoption.frames != nullptr || adoption.restoration != nullptr) frames_->setBase();
    if (adoption.period_ns != 0) {
        clock_.period_ns = adoption.period_ns;
        clock_.elapsed_ns = adoption.period_ns;
        for (const Step& step : schedule_->steps)
            accessTo(*step.component).context().period_ns = adoption.period_ns * step.every;
    }
    statistics_.adoption.add(readCycleCounter() - begin);
}

// Rewires connections and calls the hooks of new and leaving components. They see the time of the
// cycle that begins here.
void Cycle::changeComponents(Adoption& adoption) noexcept {
    const std::int64_t time = clock_.time_ns;
    const std::int64_t stamp = clock_.stamp_ns;
    if (active_) setTimes(boundary_time_ns_);
    const auto new_inputs =
        adoption.rewires.begin() + static_cast<std::ptrdiff_t>(adoption.rewires_of_new);
    std::for_each(adoption.rewires.begin(), new_inputs, [](Rewire& each) { each.apply(); });
    for (HandOver& hand_over : adoption.hand_overs) {
        // The exception may have left any state.
        hand_over.skipped = accessTo(*hand_over.previous).context().disabled;
        if (hand_over.skipped) continue;
        for (const StateCopy& state : hand_over.states) state.copy();
        // Its writes here are later than those of its hooks, and earlier than the first cycle's.
        Component& successor = *hand_over.successor;
        accessTo(successor).setTime(active_ ? boundary_time_ns_ - 1 : successor.time() + 1);
        const RealtimeHookNote note(notes_, accessTo(successor).context().recorder_slot,
                                    Hook::TakeOver);
        successor.takeOver(Predecessor(*hand_over.previous));
        publish(successor);
    }
    if (active_) {
        for (Leaving& leaving : adoption.leaving) {
            // If the component threw, its safe() has already run. A fault of a leaving component
            // does not end the loop.
            accessTo(*leaving.component).setTime(boundary_time_ns_);
            for (InputPort* input : accessTo(*leaving.component).inputs()) input->connectWritten();
            if (!accessTo(*leaving.component).context().disabled)
                makeSafe(*leaving.component, *leaving.statistics, OnBadOutput::GoOn);
            for (const Latch& latch : leaving.latches) copy(latch);
            for (SerializedTap* tap : leaving.serialized_taps) tap->push(clock_.stamp_ns);
            leaving.last_stamp_ns = clock_.stamp_ns;
        }
    }
    std::for_each(new_inputs, adoption.rewires.end(), [](Rewire& each) { each.apply(); });
    clock_.time_ns = time;
    clock_.stamp_ns = stamp;
}

// Publishes what takeOver() wrote to staged outputs. The cycle reports values that are not finite.
void Cycle::publish(Component& successor) noexcept {
    for (OutputPort* output : accessTo(successor).stagedOutputs()) {
        if (!output->valid()) continue;
        try {
            output->commit();
        } catch (...) {
            output->discard();  // no memory: readers wait for the first cycle
        }
    }
}

void Cycle::capture(Capture& capture) noexcept {
    for (const StateCopy& state : capture.states) state.copy();
    bool room = true;
    for (Capture::Value& value : capture.values) room = value.take() && room;
    for (Capture::Topic& topic : capture.topics) {
        topic.value.from = topic.injector->front();
        room = topic.value.take() && room;
    }
    for (Capture::Input& input : capture.inputs) room = input.take() && room;
    for (Capture::Turn& turn : capture.turns) {
        turn.updated_ns = turn.context->updated_ns;
        turn.elapsed_ns = turn.context->elapsed_ns;
        turn.disabled = turn.context->disabled;
    }
    capture.clock = {clock_.iteration, clock_.time_ns, clock_.stamp_ns, clock_.elapsed_ns,
                     total_elapsed_ns_};
    capture.lacks_room = !room;
}

bool Cycle::restore(Restoration& restoration) noexcept {
    for (const Restoration::Turn& turn : restoration.turns) {
        if (!turn.context->disabled) continue;
        restoration.taken_out = turn.context;
        return false;
    }
    for (const StateCopy& state : restoration.states) state.copy();
    for (const Restoration::Value& value : restoration.values) value.put();
    for (const Step& step : schedule_->steps) {
        for (OutputPort* output : accessTo(*step.component).outputs()) output->dropDraft();
    }
    const ClockState& saved = restoration.clock;
    const std::int64_t later = restoration.sets_time ? 0 : clock_.time_ns - saved.time_ns;
    for (SlotHeader* header : restoration.headers) header->stamp = movedStamp(header->stamp, later);
    for (Restoration::Topic& topic : restoration.topics) {
        Injector& injector = *topic.injector;
        topic.slot->stamp = movedStamp(topic.slot->stamp, later);
        injector.restore(topic.slot, topic.arrived_ns);
        // In a running loop it is old, of its true age. Steps go on exactly from the snapshot.
        if (!restoration.sets_time)
            injector.setAge(monotonicNow() - topic.arrived_ns, clock_.time_ns);
        for (const Restoration::Input& reader : topic.readers) {
            reader.put(injector.front(), later);
            if (!restoration.sets_time && reader.held == nullptr)
                reader.input->injectOld(injector.front());
        }
    }
    for (const Restoration::Input& input : restoration.inputs)
        input.put(&input.input->slot(), later);
    for (SerializedTap* tap : schedule_->serialized_taps) tap->forget();
    restored_ = true;
    attention_.request(Attention::kArrived);  // a plain cycle does not look at restored_
    for (const Restoration::Turn& turn : restoration.turns) {
        turn.context->updated_ns = turn.updated_ns;
        turn.context->elapsed_ns = turn.elapsed_ns;
    }
    clock_.iteration = saved.iteration;
    statistics_.iteration.store(saved.iteration, std::memory_order_relaxed);
    total_elapsed_ns_ = saved.total_elapsed_ns;
    if (restoration.sets_time) {
        clock_.time_ns = saved.time_ns;
        monotonic_ = false;  // the snapshot may be of another boot
        clock_.stamp_ns = saved.stamp_ns;
        clock_.elapsed_ns = saved.elapsed_ns;
        setStampOffset(saved.stamp_ns - saved.time_ns);
    }
    return true;
}

}  // namespace rtcf::executor

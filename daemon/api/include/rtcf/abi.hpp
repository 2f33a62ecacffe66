/// @file
/// Fingerprint of the binary interface between components and the executor: a hash of the sizes,
/// offsets and order of all that both sides use. A component built with other headers, or with
/// compiler options that change a layout (e.g. -D_GLIBCXX_DEBUG), has another fingerprint, and the
/// executor rejects it. Included by component.hpp.
#pragma once

#include <cstddef>
#include <cstdint>
#include <cstring>
#include <initializer_list>

#include "rtcf/component.hpp"  // if this header is included alone
#include "rtcf/registration.hpp"
#include "rtcf/version.hpp"

#pragma GCC diagnostic push
#pragma GCC diagnostic ignored "-Winvalid-offsetof"

namespace rtcf {

/// Offsets of a port's members, bytes, for code that is not compiled by a C++ compiler (components
/// in Python).
struct PortPlaces {
    std::size_t source;  ///< inputs: pointer to the slot with the value
    std::size_t seen;    ///< inputs: stamp of the value of the last read
    std::size_t raw;     ///< outputs: pointer to the slot that it writes
    std::size_t now;     ///< outputs: pointer to the component's time, which stamps it
    constexpr bool operator==(const PortPlaces& other) const noexcept {
        return source == other.source && seen == other.seen && raw == other.raw && now == other.now;
    }
};

struct AbiProbe {
    static constexpr PortPlaces portPlaces() noexcept {
        return {offsetof(InputBase, source_), offsetof(InputBase, seen_),
                offsetof(OutputBase, raw_), offsetof(OutputBase, now_)};
    }
    /// @param meaning RTCF_ABI_VERSION, raised by hand when a meaning changes but no layout
    static std::uint32_t fingerprint(std::uint32_t meaning) noexcept {
        std::uint64_t hash = detail::stateHash(meaning, detail::stateHash("rtcf"));
        const auto add = [&hash](std::initializer_list<std::size_t> numbers) {
            for (const std::size_t number : numbers) hash = detail::stateHash(number, hash);
        };
        add({sizeof(Component), alignof(Component), offsetof(Component, context_),
             offsetof(Component, rest_), offsetof(Component, now_), sizeof(Source),
             sizeof(Component::Rest)});
        using Rest = Component::Rest;
        add({offsetof(Rest, frozen), offsetof(Rest, input_ports), offsetof(Rest, inputs),
             offsetof(Rest, outputs), offsetof(Rest, parameters), offsetof(Rest, derived),
             offsetof(Rest, mailboxes), sizeof(MailboxBase), offsetof(MailboxBase, open_),
             offsetof(Rest, states), offsetof(Rest, staged_outputs), offsetof(Rest, failure)});
        using Context = ComponentContext;
        add({sizeof(Context),
             offsetof(Context, full_name),
             offsetof(Context, name),
             offsetof(Context, ns),
             offsetof(Context, runner),
             offsetof(Context, clock),
             offsetof(Context, period_ns),
             offsetof(Context, elapsed_ns),
             offsetof(Context, updated_ns),
             offsetof(Context, disabled),
             offsetof(Context, recorder_slot),
             offsetof(Context, device),
             offsetof(Context, faults),
             offsetof(Context, log),
             offsetof(Context, gate),
             offsetof(Context, remaps),
             offsetof(Context, log_level),
             offsetof(Context, said),
             sizeof(LogMemory),
             offsetof(Context, memory),
             offsetof(Context, object_size),
             sizeof(ComponentRecord)});
        add({sizeof(detail::ObjectHead), offsetof(detail::ObjectHead, memory),
             offsetof(detail::ObjectHead, size), offsetof(detail::ObjectHead, alignment)});
        add({sizeof(LoopClock), offsetof(LoopClock, iteration), offsetof(LoopClock, time_ns),
             offsetof(LoopClock, stamp_ns), offsetof(LoopClock, period_ns),
             offsetof(LoopClock, elapsed_ns)});
        add({sizeof(DeviceStatistics), offsetof(DeviceStatistics, calls),
             offsetof(DeviceStatistics, time_ns)});
        add({sizeof(InputBase), offsetof(InputBase, source_), offsetof(InputBase, seen_)});
        add({sizeof(OutputBase), offsetof(OutputBase, raw_), offsetof(OutputBase, now_),
             offsetof(OutputBase, port_), sizeof(OutputPort), offsetof(OutputPort, output_),
             offsetof(OutputPort, name_), offsetof(OutputPort, type_), offsetof(OutputPort, slot_),
             offsetof(OutputPort, staged_), offsetof(OutputPort, sample_),
             offsetof(OutputPort, written_), offsetof(OutputPort, draft_),
             offsetof(OutputPort, connected_), offsetof(OutputPort, checked_),
             offsetof(OutputPort, policy_), offsetof(OutputPort, texts_)});
        add({sizeof(InputPort),
             offsetof(InputPort, input_),
             offsetof(InputPort, owner_),
             offsetof(InputPort, name_),
             offsetof(InputPort, type_),
             offsetof(InputPort, queue_),
             offsetof(InputPort, connected_),
             offsetof(InputPort, fed_),
             offsetof(InputPort, awaited_),
             offsetof(InputPort, texts_),
             sizeof(QueueBase),
             offsetof(QueueBase, ring_),
             sizeof(QueueBase::Ring),
             offsetof(QueueBase::Ring, capacity),
             offsetof(QueueBase::Ring, at),
             offsetof(QueueBase::Ring, slots),
             offsetof(QueueBase::Ring, oldest),
             offsetof(QueueBase::Ring, count),
             offsetof(QueueBase::Ring, dropped),
             offsetof(QueueBase::Ring, sample),
             offsetof(QueueBase::Ring, port)});
        add({sizeof(SlotHeader), offsetof(SlotHeader, stamp), offsetof(Slot<double>, value)});
        add({sizeof(TypeInfo),
             offsetof(TypeInfo, name),
             offsetof(TypeInfo, size),
             offsetof(TypeInfo, ros_type),
             offsetof(TypeInfo, fixed_size),
             offsetof(TypeInfo, flat),
             offsetof(TypeInfo, builds_message),
             offsetof(TypeInfo, is_double),
             offsetof(TypeInfo, plain),
             offsetof(TypeInfo, make_slot),
             offsetof(TypeInfo, copy),
             offsetof(TypeInfo, exchange),
             offsetof(TypeInfo, length),
             offsetof(TypeInfo, serialize),
             offsetof(TypeInfo, deserialize),
             offsetof(TypeInfo, print),
             offsetof(TypeInfo, finite),
             offsetof(TypeInfo, sample),
             offsetof(TypeInfo, copies),
             sizeof(ByteCopy)});
        using Declaration = ParameterDeclaration;
        add({sizeof(ParameterBase), offsetof(ParameterBase, place_), sizeof(Parameter<double>),
             offsetof(Parameter<double>, value_), sizeof(ParameterValue), sizeof(Declaration),
             offsetof(Declaration, name), offsetof(Declaration, type),
             offsetof(Declaration, default_value), offsetof(Declaration, minimum),
             offsetof(Declaration, maximum), offsetof(Declaration, unit),
             offsetof(Declaration, doc), offsetof(Declaration, choices),
             offsetof(Declaration, is_size), offsetof(Declaration, fixed), sizeof(Choice),
             sizeof(DerivedBase), sizeof(StagedValue)});
        add({sizeof(StateDeclaration), offsetof(StateDeclaration, name),
             offsetof(StateDeclaration, type), offsetof(StateDeclaration, identity),
             offsetof(StateDeclaration, size), offsetof(StateDeclaration, value),
             offsetof(StateDeclaration, initial), offsetof(StateDeclaration, live),
             offsetof(StateDeclaration, print)});
        add({sizeof(LogRecord), offsetof(LogRecord, site), offsetof(LogRecord, component),
             offsetof(LogRecord, time_ns), offsetof(LogRecord, iteration),
             offsetof(LogRecord, realtime), offsetof(LogRecord, render),
             offsetof(LogRecord, payload), sizeof(LogSite), offsetof(LogSite, format)});
        add({placeOf(&Component::prepare), placeOf(&Component::configure),
             placeOf(&Component::start), placeOf(&Component::update), placeOf(&Component::safe),
             placeOf(&Component::stop), placeOf(&Component::cleanup), placeOf(&Component::takeOver),
             placeOf(&Source::wait), placeOf(&StagedValue::commit), placeOf(&StagedValue::release),
             placeOf(&DerivedBase::propose), placeOf(&ParameterBase::stage),
             placeOf(&LogSink::claim), placeOf(&LogSink::commit),
             placeOf(&ComponentMemory::allocate), placeOf(&ComponentMemory::release)});
        return static_cast<std::uint32_t>(hash ^ (hash >> 32));
    }

   private:
    // A pointer to a virtual member function contains its index in the vtable.
    template <typename Function>
    static std::size_t placeOf(Function function) noexcept {
        std::size_t place = 0;
        std::memcpy(&place, &function, sizeof place);
        return place;
    }
};

}  // namespace rtcf

#pragma GCC diagnostic pop

// Weak, because every source file with a component defines it; all definitions are the same.
extern "C" __attribute__((weak, visibility("default"))) const rtcf::PluginDescriptor*
RTCF_ENTRY_POINT() {
    static rtcf::PluginDescriptor descriptor{rtcf::AbiProbe::fingerprint(RTCF_ABI_VERSION),
                                             sizeof(rtcf::PluginDescriptor), RTCF_VERSION, nullptr};
    descriptor.components = rtcf::detail::component_records;
    return &descriptor;
}

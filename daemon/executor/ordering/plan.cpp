#include "ordering/plan.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <set>

#include "common/error.hpp"
#include "ordering/footprint.hpp"

namespace rtcf::executor {

namespace {

// A serialized tap holds the values of half a second, because its reader is a thread that shares
// the machine with everything else.
constexpr double kTapSeconds = 0.5;
constexpr std::size_t kVariableTapValues = 2;  // number of largest values, if they are not flat
// Taps of larger types hold fewer values, but at least two, because rings are locked memory.
constexpr std::size_t kMiB = 1024 * 1024;
constexpr std::size_t kLargestTap = 8 * kMiB;
constexpr std::size_t kAllTaps = 256 * kMiB;

std::size_t tapCapacity(const TypeInfo& type, double frequency_hz, std::size_t largest) {
    if (!type.flat) return kVariableTapValues * (largest + 24);
    const std::size_t record = SerializedTap::recordBytes(type);
    const auto values =
        static_cast<std::size_t>(std::clamp(frequency_hz * kTapSeconds, 64.0, 16384.0));
    return std::min(record * values, kLargestTap);
}

class Builder {
   public:
    Builder(Plan& plan, const Plan& previous, double frequency_hz, Adoption& adoption,
            const BridgeSettings& bridge)
        : plan_(plan),
          previous_(previous),
          frequency_hz_(frequency_hz),
          adoption_(adoption),
          bridge_(bridge),
          decimated_("decimate", bridge.decimate) {}

    void build() {
        plan_.schedule.generation = previous_.schedule.generation + 1;
        positions_.resize(plan_.graph.nodes().size());
        for (std::size_t i = 0; i < plan_.wiring.order.size(); ++i)
            positions_[plan_.wiring.order[i]] = i;
        for (const auto& [name, connection] : plan_.wiring.connections)
            addConnection(name, connection);
        addSteps();
        addWaiting();
        addLeaving();
        // Puts the rewires of new inputs first. So a new component has its inputs in takeOver(),
        // and a leaving component writes its last values before its readers are connected to new
        // writers.
        adoption_.rewires_of_new = static_cast<std::size_t>(
            std::stable_partition(adoption_.rewires.begin(), adoption_.rewires.end(),
                                  [this](const Rewire& rewire) {
                                      return previous_.bindings.count(rewire.input) == 0;
                                  }) -
            adoption_.rewires.begin());
        plan_.schedule.footprint = footprint(plan_.schedule, [this](const InputPort* input) {
            const auto binding = plan_.bindings.find(input);
            return binding == plan_.bindings.end() ? nullptr : binding->second.source;
        });
        adoption_.schedule = &plan_.schedule;
    }

   private:
    void addConnection(const std::string& name, const ConnectionPlan& connection) {
        if (connection.published) {
            addTap(name, name, *connection.writer);
            // A mapped name contains no blank, so this key is unique.
            for (const Writer& writer : connection.others) {
                const Instance& instance = *plan_.graph.nodes()[writer.node].instance;
                addTap(name + " of " + instance.fullName() + "." + writer.output->name(), name,
                       writer);
            }
        }
        if (connection.writer) {
            for (const Reader& reader : connection.readers) bindToWriter(connection, reader);
            OutputPort& output = *connection.writer->output;
            const bool heard = connection.published || !connection.readers.empty();
            if (heard != output.connected()) adoption_.audiences.push_back({&output, heard});
            for (const Writer& writer : connection.others) {
                if (connection.published != writer.output->connected())
                    adoption_.audiences.push_back({writer.output, connection.published});
            }
        } else if (connection.subscribed || connection.written) {
            addFeed(name, connection);
        } else {
            for (const Reader& reader : connection.readers) unbind(reader.input);
        }
    }

    void addTap(const std::string& key, const std::string& name, const Writer& writer) {
        const std::shared_ptr<const SlotHeader> slot = writer.output->slot();
        const std::uint32_t decimation = decimated_.matches(name) ? bridge_.decimation : 1;
        if (writer.output->type().fixed_size) {
            const auto found = previous_.frame_taps.find(key);
            const std::shared_ptr<FrameTap> tap =
                found != previous_.frame_taps.end() && found->second->source() == slot.get()
                    ? found->second
                    : std::make_shared<FrameTap>(name, writer.output->type(), slot);
            tap->setDecimation(decimation);
            plan_.schedule.frame_taps.push_back(tap.get());
            plan_.frame_taps.emplace(key, tap);
        } else {
            const std::shared_ptr<SerializedTap> tap = serializedTap(key, name, *writer.output);
            tap->setDecimation(decimation);
            plan_.schedule.serialized_taps.push_back(tap.get());
            plan_.serialized_taps.emplace(key, tap);
        }
    }

    std::shared_ptr<SerializedTap> serializedTap(const std::string& key, const std::string& name,
                                                 const OutputPort& output) {
        const std::size_t largest = bridge_.largest_message;
        const std::size_t capacity = tapCapacity(output.type(), frequency_hz_, largest);
        std::shared_ptr<SerializedTap> tap;
        if (const auto found = previous_.serialized_taps.find(key);
            found != previous_.serialized_taps.end() &&
            found->second->source() == output.slot().get() && found->second->largest() == largest) {
            tap = found->second;
        } else {
            tap = std::make_shared<SerializedTap>(name, output.type(), output.slot(), capacity,
                                                  largest);
        }
        // Also counts the size that the tap would have at the present frequency, so that the same
        // graph can be built again later.
        requireRoom(std::max(tap->ringBytes(), SerializedTap::ringBytes(output.type(), capacity)));
        return tap;
    }

    void requireRoom(std::size_t ring_bytes) {
        tap_bytes_ += ring_bytes;
        if (tap_bytes_ <= kAllTaps) return;
        throw Error(
            ErrorKind::ResourceExhausted,
            fmt::format("the rings of all published outputs of variable size (taps) would take "
                        "more than the {} MiB of locked memory allowed: reduce the whitelist, the "
                        "frequency or the largest message",
                        kAllTaps / kMiB));
    }

    void addFeed(const std::string& name, const ConnectionPlan& connection) {
        std::shared_ptr<Injector> injector;
        if (const auto found = previous_.injectors.find(name);
            found != previous_.injectors.end() &&
            sameType(found->second->type(), *connection.type)) {
            injector = found->second;
        } else {
            injector = std::make_shared<Injector>(name, *connection.type);
        }
        injector->setLargest(bridge_.largest_message);
        Feed feed{injector.get(), {}, {}};
        for (const Reader& reader : connection.readers) {
            feed.readers.push_back(reader.input);
            Binding binding = present(reader.input);
            if (reader.input->queue() != nullptr)
                feed.backlogs.push_back(backlogOf(*injector, *reader.input->queue()));
            if (binding.writer != injector.get()) {
                adoption_.rewires.push_back({reader.input, nullptr, injector.get(), false, false});
                binding.writer = injector.get();
                binding.source = nullptr;
                binding.source_owner = injector;
            }
            plan_.bindings.emplace(reader.input, std::move(binding));
        }
        plan_.schedule.feeds.push_back(std::move(feed));
        plan_.injectors.emplace(name, std::move(injector));
    }

    std::shared_ptr<Backlog> backlogOf(const Injector& injector, QueueBase& queue) const {
        for (const Feed& feed : previous_.schedule.feeds) {
            if (feed.injector != &injector) continue;
            for (const auto& backlog : feed.backlogs)
                if (&backlog->queue() == &queue) return backlog;
        }
        return std::make_shared<Backlog>(queue);
    }

    void bindToWriter(const ConnectionPlan& connection, const Reader& reader) {
        if (QueueBase* const queue = reader.input->queue()) plan_.schedule.queues.push_back(queue);
        const std::shared_ptr<SlotHeader>& slot = connection.writer->output->slot();
        // A loop break always reads the previous cycle, even if the writer runs earlier in this
        // one.
        const bool latched =
            reader.broken && positions_[connection.writer->node] <= positions_[reader.node];
        const std::shared_ptr<SlotHeader> source =
            latched ? latchOf(*connection.writer, slot) : slot;
        Binding binding = present(reader.input);
        if (binding.writer != slot.get() || binding.source != source.get()) {
            const bool arrived = reader.input->queue() != nullptr && arrives(*connection.writer);
            adoption_.rewires.push_back(
                {reader.input, source.get(), nullptr, binding.writer == slot.get(), arrived});
            binding.writer = slot.get();
            binding.source = source.get();
            binding.source_owner = source;
        }
        plan_.bindings.emplace(reader.input, std::move(binding));
    }

    bool arrives(const Writer& writer) const {
        const auto& previous = previous_.graph.nodes();
        const Instance* const instance = plan_.graph.nodes()[writer.node].instance.get();
        return std::none_of(previous.begin(), previous.end(), [instance](const GraphNode& node) {
            return node.instance.get() == instance;
        });
    }

    std::shared_ptr<SlotHeader> latchOf(const Writer& writer,
                                        const std::shared_ptr<SlotHeader>& slot) {
        std::shared_ptr<SlotHeader>& latch = plan_.latches[slot.get()];
        if (!latch) {
            const TypeInfo& type = writer.output->type();
            const auto found = previous_.latches.find(slot.get());
            const bool is_new = found == previous_.latches.end();
            latch =
                is_new
                    ? type.make_slot(plan_.graph.nodes()[writer.node].instance->sample(writer.port))
                    : found->second;
            plan_.schedule.latches.push_back(
                {&type, latch.get(), slot.get(),
                 &plan_.graph.nodes()[writer.node].instance->component()});
            if (is_new) adoption_.new_latches.push_back(plan_.schedule.latches.back());
        }
        return latch;
    }

    void unbind(InputPort* input) {
        Binding binding = present(input);
        // The input never had a writer, nor a value from a snapshot.
        if (binding.source_owner == nullptr && binding.held_owner == nullptr) return;
        if (binding.writer != nullptr)
            adoption_.rewires.push_back({input, nullptr, nullptr, false, false});
        binding.writer = nullptr;
        plan_.bindings.emplace(input, std::move(binding));
    }

    Binding present(const InputPort* input) const {
        const auto found = previous_.bindings.find(input);
        if (found == previous_.bindings.end()) return {};
        Binding binding = found->second;
        if (binding.source != nullptr && binding.writer != nullptr && !input->waiting()) {
            binding.held = nullptr;
            binding.held_owner = nullptr;
        }
        return binding;
    }

    void addSteps() {
        for (const std::size_t index : plan_.wiring.order) {
            Instance& instance = *plan_.graph.nodes()[index].instance;
            const ComponentDefinition& definition = instance.definition();
            plan_.schedule.steps.push_back({&instance.component(), updateOf(instance.component()),
                                            instance.slot(), definition.every});
            plan_.schedule.turns.push_back(
                {instance.statistics().get(), instance.phase(), definition.optional});
            if (Source* source = instance.source(); source != nullptr)
                plan_.schedule.source = source;
        }
        plan_.schedule.findStretches();
    }

    void addWaiting() {
        std::set<const InputPort*> rewired;
        for (const Rewire& rewire : adoption_.rewires) rewired.insert(rewire.input);
        for (const Step& step : plan_.schedule.steps) {
            for (InputPort* input : accessTo(*step.component).inputs()) {
                if (adoption_.restoration != nullptr || input->waiting() ||
                    rewired.count(input) != 0)
                    adoption_.waiting.push_back({&step, input});
            }
        }
    }

    void addLeaving() {
        std::set<const Instance*> staying;
        for (const GraphNode& node : plan_.graph.nodes()) staying.insert(node.instance.get());
        for (const std::size_t index : previous_.wiring.order) {
            const Instance& instance = *previous_.graph.nodes()[index].instance;
            if (staying.count(&instance) != 0) continue;
            Leaving leaving{&instance.component(), instance.statistics().get(), {}, {}, {}};
            for (const OutputPort* output : accessTo(instance.component()).outputs()) {
                const SlotHeader* const slot = output->slot().get();
                if (const auto found = previous_.latches.find(slot);
                    found != previous_.latches.end())
                    leaving.latches.push_back(
                        {&output->type(), found->second.get(), slot, leaving.component});
                for (const auto& [topic, tap] : previous_.serialized_taps)
                    if (tap->source() == slot) leaving.serialized_taps.push_back(tap.get());
                for (const auto& [topic, tap] : previous_.frame_taps)
                    if (tap->source() == slot) leaving.frame_taps.push_back(tap.get());
            }
            adoption_.leaving.push_back(std::move(leaving));
        }
    }

    Plan& plan_;
    const Plan& previous_;
    double frequency_hz_;
    Adoption& adoption_;
    const BridgeSettings& bridge_;
    NamePattern decimated_;
    std::vector<std::size_t> positions_;  // position in the order, by node
    std::size_t tap_bytes_ = 0;           // size of the rings so far, bytes
};

}  // namespace

void Plan::noteHeld(const Adoption& adoption, const Plan& previous) noexcept {
    for (const Rewire& rewire : adoption.rewires) {
        const auto found = bindings.find(rewire.input);
        const auto before = previous.bindings.find(rewire.input);
        if (found == bindings.end() || before == previous.bindings.end() || rewire.continued ||
            rewire.held == before->second.held)
            continue;
        found->second.held = rewire.held;
        found->second.held_owner = before->second.source_owner;
    }
}

BridgeTable Plan::bridgeTable() const {
    BridgeTable table;
    std::map<std::string, std::shared_ptr<Tap>> taps(frame_taps.begin(), frame_taps.end());
    taps.insert(serialized_taps.begin(), serialized_taps.end());
    for (const auto& [name, tap] : taps) table.outputs.push_back(tap);
    for (const auto& [name, injector] : injectors) {
        if (wiring.connections.at(name).subscribed) table.inputs.push_back(injector);
    }
    return table;
}

std::unique_ptr<Plan> buildPlan(Graph graph, Wiring wiring, const Plan& previous,
                                double frequency_hz, Adoption& adoption,
                                const BridgeSettings& bridge) {
    auto plan = std::make_unique<Plan>();
    plan->graph = std::move(graph);
    plan->wiring = std::move(wiring);
    Builder(*plan, previous, frequency_hz, adoption, bridge).build();
    return plan;
}

}  // namespace rtcf::executor

#include "ordering/wiring.hpp"

#include <fmt/format.h>

#include "common/error.hpp"
#include "ordering/order.hpp"
#include "ordering/rates.hpp"

namespace rtcf::executor {

namespace {

std::string portName(const Graph& graph, std::size_t node, const std::string& port) {
    return graph.nodes()[node].instance->fullName() + "." + port;
}

// A component's name for rtcfctl, without the slash of the root namespace.
std::string shortName(const std::string& full_name) {
    return full_name.rfind('/') == 0 ? full_name.substr(1) : full_name;
}

// A type for an error text; with the md5 only if both types have the same name.
std::string describe(const TypeInfo& type, const TypeInfo& other) {
    if (std::string_view(type.name) != other.name) return type.name;
    return fmt::format("{} (md5 {}, {} bytes)", type.name, type.md5, type.size);
}

[[noreturn]] void refuseTypes(const std::string& name, const std::string& present,
                              const TypeInfo& present_type, const std::string& added,
                              const TypeInfo& added_type) {
    if (std::string_view(present_type.name) == added_type.name && isPrivate(added_type)) {
        throw Error(ErrorKind::TypesDiffer,
                    fmt::format("types differ on {}: {} and {} are {} of different source files or "
                                "builds; name the fields of the struct, or declare it in a header, "
                                "in a named namespace",
                                name, present, added, added_type.name));
    }
    throw Error(
        ErrorKind::TypesDiffer,
        fmt::format("types differ on {}: {} is {}, {} is {}; remap one of them to another name",
                    name, present, describe(present_type, added_type), added,
                    describe(added_type, present_type)));
}

class Collector {
   public:
    Collector(const Graph& graph, std::map<std::string, ConnectionPlan>& connections)
        : graph_(graph), connections_(connections) {}

    void addNode(std::size_t index) {
        const GraphNode& node = graph_.nodes()[index];
        const Instance& instance = *node.instance;
        const auto& ports = *instance.ports();
        const auto& outputs = accessTo(instance.component()).outputs();
        for (std::size_t i = 0; i < outputs.size(); ++i)
            addOutput(index, i, outputs[i], ports[instance.placeOfOutput(i)].mapped_name);
        const auto& inputs = accessTo(instance.component()).inputs();
        for (std::size_t i = 0; i < inputs.size(); ++i)
            addInput(index, node, inputs[i], ports[i].mapped_name);
    }

   private:
    ConnectionPlan& planFor(const std::string& name, std::size_t index, const std::string& port,
                            const TypeInfo& type) {
        ConnectionPlan& plan = connections_[name];
        if (plan.type == nullptr) {
            plan.type = &type;
        } else if (!sameType(*plan.type, type)) {
            const std::string present =
                plan.writer ? portName(graph_, plan.writer->node, plan.writer->output->name())
                            : portName(graph_, plan.readers[0].node, plan.readers[0].input->name());
            refuseTypes(name, present, *plan.type, portName(graph_, index, port), type);
        }
        return plan;
    }

    void addOutput(std::size_t index, std::size_t port, OutputPort* output,
                   const std::string& name) {
        ConnectionPlan& plan = planFor(name, index, output->name(), output->type());
        if (plan.writer) {
            plan.others.push_back({index, port, output});
        } else {
            plan.writer = Writer{index, port, output};
        }
    }

    void addInput(std::size_t index, const GraphNode& node, InputPort* input,
                  const std::string& name) {
        ConnectionPlan& plan = planFor(name, index, input->name(), input->type());
        plan.readers.push_back({index, input, node.breaks.include(input->name(), name)});
    }

    const Graph& graph_;
    std::map<std::string, ConnectionPlan>& connections_;
};

// How to break the connections of `cut` in an applied graph.
std::string breakKeys(const Graph& graph, const std::vector<Edge>& cut) {
    std::map<std::string, std::string> ports;
    for (const Edge& edge : cut) {
        std::string& listed = ports[graph.nodes()[edge.to].instance->fullName()];
        listed += (listed.empty() ? "" : ", ") + edge.to_port;
    }
    std::string advice;
    for (const auto& [component, listed] : ports) {
        advice += fmt::format("{}`breaks: [{}]` of {}", advice.empty() ? "" : " and ", listed,
                              shortName(component));
    }
    return advice;
}

std::string breakCommand(const Graph& graph, const std::vector<Edge>& cut,
                         const std::string& loading) {
    std::string command;
    std::string options;
    for (const Edge& edge : cut) {
        const std::string& component = graph.nodes()[edge.to].instance->fullName();
        if (component == loading) {
            options += " --break " + edge.to_port;
        } else {
            command += fmt::format(" {}.{}", shortName(component), edge.to_port);
        }
    }
    std::string advice;
    if (!command.empty()) advice = fmt::format("`rtcfctl break{}`", command);
    if (!options.empty()) {
        advice += fmt::format("{}loading {} with `{}`", advice.empty() ? "" : " and ",
                              shortName(loading), options.substr(1));
    }
    return advice;
}

[[noreturn]] void refuseLoop(const Graph& graph, const OrderResult& result, const Origin& origin) {
    // Of a long loop, only both ends are shown.
    constexpr std::size_t kListedAtEachEnd = 10;
    constexpr std::size_t kListedCuts = 5;
    const std::size_t length = result.loop.size();
    std::string loop;
    for (std::size_t i = 0; i < length; ++i) {
        if (length > 2 * kListedAtEachEnd && i == kListedAtEachEnd) {
            i = length - kListedAtEachEnd;
            loop += fmt::format(" → … {} more connections …", length - 2 * kListedAtEachEnd);
        }
        const Edge& edge = result.loop[i];
        loop += fmt::format("{}{} → {}", loop.empty() ? "" : " → ",
                            portName(graph, edge.from, edge.from_port),
                            portName(graph, edge.to, edge.to_port));
    }
    std::string advice;
    for (std::size_t i = 0; i < result.cuts.size() && i < kListedCuts; ++i) {
        const std::vector<Edge>& cut = result.cuts[i];
        advice +=
            (advice.empty() ? "" : ", or ") +
            (origin.applied ? breakKeys(graph, cut) : breakCommand(graph, cut, origin.loading));
    }
    if (result.cuts.size() > kListedCuts) advice += ", or elsewhere in the loop";
    throw Error(
        ErrorKind::ConnectionsFormLoop,
        fmt::format("the connections form a loop: {}; let one input read the previous cycle: {}",
                    loop, advice));
}

OrderProblem orderProblem(const Graph& graph, const Wiring& wiring) {
    OrderProblem problem;
    for (const GraphNode& node : graph.nodes()) {
        problem.names.push_back(node.instance->fullName());
        problem.first.push_back(node.breaks.first);
    }
    for (const auto& [name, plan] : wiring.connections) {
        if (!plan.writer) continue;
        for (const Reader& reader : plan.readers) {
            if (!reader.broken) {
                problem.edges.push_back({plan.writer->node, reader.node,
                                         plan.writer->output->name(), reader.input->name()});
            }
        }
    }
    return problem;
}

// Requires one writer if there is a reader. Without a reader, several outputs may write a topic, as
// several nodes may publish it.
void requireOneWriter(const Graph& graph, const std::string& name, const ConnectionPlan& plan) {
    if (!plan.writer || plan.others.empty() || plan.readers.empty()) return;
    const Writer& other = plan.others.front();
    const std::string& port = other.output->name();
    throw Error(
        ErrorKind::TwoWriters,
        fmt::format("{} has two writers and a reader: {} and {} write it, {} reads it; remap one "
                    "writer, e.g. --remap {}:=~{}",
                    name, portName(graph, plan.writer->node, plan.writer->output->name()),
                    portName(graph, other.node, port),
                    portName(graph, plan.readers[0].node, plan.readers[0].input->name()), port,
                    port));
}

// True if the type has a ROS message; others stay inside the runner.
bool onRos(const TypeInfo& type) { return *type.ros_type != '\0'; }

// Rejects types whose messages would be allocated in the cycle: the values own memory, so they
// cannot be copied bytewise for the consumer, which builds other messages.
void requirePublishable(const Graph& graph, const std::string& name, const Writer& writer) {
    const TypeInfo& type = writer.output->type();
    if (!allocatesMessage(type)) return;
    throw Error(
        ErrorKind::FailedPrecondition,
        fmt::format("{} cannot be published as {}: values of {} own memory, and so do "
                    "messages of {}, which would be allocated in the cycle; exclude {} from the "
                    "whitelist, or store the values in a std::array",
                    portName(graph, writer.node, writer.output->name()), name, type.name,
                    type.ros_type, name));
}

// Only one device can pace the loop.
void requireOneSource(const Graph& graph) {
    const Instance* present = nullptr;
    for (const GraphNode& node : graph.nodes()) {
        if (node.instance->source() == nullptr) continue;
        if (present != nullptr) {
            throw Error(
                ErrorKind::TwoPacers,
                fmt::format("{} and {} both pace the loop: put one of them into another runner",
                            present->fullName(), node.instance->fullName()));
        }
        present = node.instance.get();
    }
}

}  // namespace

Wiring wire(const Graph& graph, const MappingFilter& filter, const Origin& origin) {
    Wiring wiring;
    requireOneSource(graph);
    assignPhases(graph, origin.loading);
    Collector collector(graph, wiring.connections);
    for (std::size_t index = 0; index < graph.nodes().size(); ++index) collector.addNode(index);
    for (auto& [name, plan] : wiring.connections) {
        const bool mapped = onRos(*plan.type) && filter.matches(name);
        plan.published = mapped && plan.writer.has_value();
        // An input with a writer in the runner is not subscribed: ROS must not bypass the real-time
        // path.
        plan.subscribed = mapped && !plan.writer.has_value();
    }
    for (const auto& [name, plan] : wiring.connections) {
        requireOneWriter(graph, name, plan);
        if (!plan.published) continue;
        requirePublishable(graph, name, *plan.writer);
        for (const Writer& writer : plan.others) requirePublishable(graph, name, writer);
    }
    OrderResult result = findOrder(orderProblem(graph, wiring));
    if (!result.orderable()) refuseLoop(graph, result, origin);
    wiring.order = std::move(result.order);
    return wiring;
}

std::vector<std::string> remarks(const Graph& graph, const Wiring& wiring,
                                 const MappingFilter& filter,
                                 const std::set<std::string>& components) {
    std::vector<bool> ours;
    for (const GraphNode& node : graph.nodes())
        ours.push_back(components.count(node.instance->fullName()) != 0);
    const auto is_ours = [&](const auto& port) { return ours[port.node]; };
    std::vector<std::string> lines;
    for (const auto& [name, plan] : wiring.connections) {
        std::vector<Writer> writers = plan.others;
        if (plan.writer) writers.insert(writers.begin(), *plan.writer);
        const bool written = std::any_of(writers.begin(), writers.end(), is_ours);
        const bool read = std::any_of(plan.readers.begin(), plan.readers.end(), is_ours);
        if (written && plan.published && writers.size() > 1) {
            std::string names;
            for (const Writer& writer : writers) {
                names += (names.empty() ? "" : ", ") +
                         portName(graph, writer.node, writer.output->name());
            }
            lines.push_back(fmt::format("topic {} has {} writers in this runner: {}", name,
                                        writers.size(), names));
        }
        if ((written || read) && !onRos(*plan.type) && filter.matches(name)) {
            lines.push_back(fmt::format("{} is not on ROS: there is no ROS message for its type {}",
                                        name, plan.type->name));
        }
    }
    return lines;
}

}  // namespace rtcf::executor

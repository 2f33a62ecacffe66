#include "graph/graph.hpp"

#include <fmt/format.h>

#include <algorithm>

#include "common/error.hpp"

namespace rtcf::executor {

const GraphNode* Graph::find(const std::string& full_name) const noexcept {
    for (const GraphNode& node : nodes_) {
        if (node.instance->fullName() == full_name) return &node;
    }
    return nullptr;
}

std::size_t Graph::indexOf(const std::string& full_name) const {
    if (const GraphNode* node = find(full_name))
        return static_cast<std::size_t>(node - nodes_.data());
    constexpr std::size_t kListed = 20;
    std::string names;
    for (std::size_t i = 0; i < nodes_.size() && i < kListed; ++i) {
        names += (i == 0 ? "" : ", ") + nodes_[i].instance->fullName();
    }
    if (nodes_.size() > kListed) names += fmt::format(" and {} more", nodes_.size() - kListed);
    throw Error(ErrorKind::NotFound, fmt::format("no component {} in this runner; loaded: {}",
                                                 full_name, names.empty() ? "none" : names));
}

const GraphNode& Graph::get(const std::string& full_name) const {
    return nodes_[indexOf(full_name)];
}

void Graph::requireFree(const std::string& full_name) const {
    if (const GraphNode* node = find(full_name)) {
        const ComponentDefinition& present = node->instance->definition();
        throw Error(
            ErrorKind::AlreadyExists,
            fmt::format(
                "{} is loaded already ({}/{}): give another --name, or use rtcfctl replace {}",
                full_name, present.package, present.type, full_name));
    }
}

void Graph::add(GraphNode node) {
    requireFree(node.instance->fullName());
    nodes_.push_back(std::move(node));
}

void Graph::remove(const std::string& full_name) {
    nodes_.erase(nodes_.begin() + static_cast<std::ptrdiff_t>(indexOf(full_name)));
}

void Graph::replace(const std::string& full_name, GraphNode node) {
    const std::size_t index = indexOf(full_name);
    if (node.instance->fullName() != full_name) requireFree(node.instance->fullName());
    nodes_[index] = std::move(node);
}

void Graph::setBreaks(const std::string& full_name, const LoopBreaks& breaks) {
    GraphNode& node = nodes_[indexOf(full_name)];
    for (const std::string& port : breaks.ports) (void)node.instance->requireInput(port);
    node.breaks = breaks;
}

void Graph::setBreak(const std::string& full_name, const std::string& port, bool broken) {
    GraphNode& node = nodes_[indexOf(full_name)];
    (void)node.instance->requireInput(port);
    if (broken) {
        node.breaks.ports.insert(port);
        return;
    }
    node.breaks.ports.erase(port);
    LoopBreaks others;
    bool remains = false;
    for (const MappedPort& each : *node.instance->ports()) {
        if (each.output || !node.breaks.include(each.name, each.mapped_name)) continue;
        if (each.name == port) {
            remains = true;
        } else {
            others.ports.insert(each.name);
        }
    }
    if (remains) node.breaks = std::move(others);
}

}  // namespace rtcf::executor

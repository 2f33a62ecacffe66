#include "ordering/construction.hpp"

#include <map>
#include <string>

#include "names/name_pattern.hpp"
#include "names/names.hpp"
#include "ordering/order.hpp"

namespace rtcf::executor {

namespace {

std::string mapped(const ComponentDefinition& definition, const MappedPort& port) {
    return mappedName(port.name, definition.ns, definition.fullName(), definition.remaps);
}

}  // namespace

std::vector<std::size_t> constructionOrder(const std::vector<Blueprint>& blueprints) {
    OrderProblem problem;
    std::map<std::string, std::size_t> writers;  // by mapped name
    for (std::size_t i = 0; i < blueprints.size(); ++i) {
        const ComponentDefinition& definition = *blueprints[i].definition;
        problem.names.push_back(definition.fullName());
        problem.first.push_back(definition.first);
        for (const MappedPort& port : *blueprints[i].ports)
            if (port.output) writers.emplace(mapped(definition, port), i);
    }
    for (std::size_t i = 0; i < blueprints.size(); ++i) {
        const ComponentDefinition& definition = *blueprints[i].definition;
        if (definition.first) continue;
        const NamePattern ignore("ignore of " + definition.fullName(), definition.ignore);
        for (const MappedPort& port : *blueprints[i].ports) {
            if (port.output || definition.breaks.count(port.name) != 0) continue;
            const std::string name = mapped(definition, port);
            const auto writer = writers.find(name);
            if (writer == writers.end() || ignore.matches(name)) continue;
            problem.edges.push_back({writer->second, i, {}, {}});
        }
    }
    std::vector<std::size_t> order = orderUpToLoops(problem);
    std::vector<bool> ordered(blueprints.size(), false);
    for (const std::size_t i : order) ordered[i] = true;
    for (std::size_t i = 0; i < blueprints.size(); ++i)
        if (!ordered[i]) order.push_back(i);
    return order;
}

}  // namespace rtcf::executor

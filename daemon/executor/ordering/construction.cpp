#include "ordering/construction.hpp"

#include <map>
#include <string>

#include "names/names.hpp"
#include "ordering/order.hpp"

namespace rtcf::executor {

namespace {

std::string mapped(const ComponentDefinition& definition, const std::string& port) {
    return mappedName(port, definition.ns, definition.fullName(), definition.remaps);
}

}  // namespace

std::vector<std::size_t> constructionOrder(const std::vector<const WantedComponent*>& wanted) {
    OrderProblem problem;
    std::map<std::string, std::size_t> writers;  // by mapped name
    for (std::size_t i = 0; i < wanted.size(); ++i) {
        const ComponentDefinition& definition = wanted[i]->definition;
        problem.names.push_back(definition.fullName());
        problem.first.push_back(definition.breaks.first);
        if (wanted[i]->ports == nullptr) continue;
        for (const std::string& port : wanted[i]->ports->outputs)
            writers.emplace(mapped(definition, port), i);
    }
    for (std::size_t i = 0; i < wanted.size(); ++i) {
        const ComponentDefinition& definition = wanted[i]->definition;
        if (wanted[i]->ports == nullptr) continue;
        for (const std::string& port : wanted[i]->ports->inputs) {
            const std::string name = mapped(definition, port);
            const auto writer = writers.find(name);
            if (writer == writers.end() || definition.breaks.include(port, name)) continue;
            problem.edges.push_back({writer->second, i, {}, {}});
        }
    }
    std::vector<std::size_t> order = orderUpToLoops(problem);
    std::vector<bool> ordered(wanted.size(), false);
    for (const std::size_t i : order) ordered[i] = true;
    for (std::size_t i = 0; i < wanted.size(); ++i)
        if (!ordered[i]) order.push_back(i);
    return order;
}

}  // namespace rtcf::executor

#include "ordering/rates.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <map>
#include <utility>
#include <vector>

#include "common/error.hpp"

namespace rtcf::executor {

namespace {

bool harmonic(std::uint32_t a, std::uint32_t b) { return a % b == 0 || b % a == 0; }

// The nearest values below and above `every` that are harmonic with all of `rates`.
std::string nearestRates(std::uint32_t every, const std::vector<std::uint32_t>& rates) {
    const auto works = [&](std::uint32_t candidate) {
        return std::all_of(rates.begin(), rates.end(),
                           [&](std::uint32_t rate) { return harmonic(candidate, rate); });
    };
    std::uint32_t below = every;
    while (!works(below)) --below;  // 1 always works
    const std::uint32_t highest = 2 * *std::max_element(rates.begin(), rates.end()) + every;
    std::uint32_t above = every;
    while (above < highest && !works(above)) ++above;
    return works(above) ? fmt::format("{} or {}", below, above) : std::to_string(below);
}

std::string suffix(std::uint32_t every) {
    return every == 1 ? "every cycle" : fmt::format("every {} cycles", every);
}

// @param loading the component to name first if it is one of two that conflict
void requireHarmonic(const Graph& graph, const std::string& loading) {
    std::map<std::uint32_t, const Instance*> of_rate;
    for (const GraphNode& node : graph.nodes()) {
        const Instance* blamed = node.instance.get();
        for (auto [rate, other] : of_rate) {
            if (harmonic(rate, blamed->definition().every)) continue;
            if (other->fullName() == loading) std::swap(blamed, other);
            std::vector<std::uint32_t> others;
            for (const GraphNode& each : graph.nodes()) {
                if (each.instance.get() != blamed)
                    others.push_back(each.instance->definition().every);
            }
            const std::uint32_t every = blamed->definition().every;
            throw Error(
                ErrorKind::RatesConflict,
                fmt::format("{} runs {}, but {} runs {}: one rate must divide the other; "
                            "try --every {}",
                            blamed->fullName(), suffix(every), other->fullName(),
                            suffix(other->definition().every), nearestRates(every, others)));
        }
        of_rate.emplace(blamed->definition().every, blamed);
    }
}

}  // namespace

void assignPhases(const Graph& graph, const std::string& loading) {
    requireHarmonic(graph, loading);
    std::uint32_t slowest = 1;
    for (const GraphNode& node : graph.nodes())
        slowest = std::max(slowest, node.instance->definition().every);
    if (slowest == 1) return;
    // Number of slower components in each cycle of the slowest rate's period.
    std::vector<std::uint32_t> load(slowest, 0);
    const auto occupy = [&](const Instance& instance) {
        for (std::uint32_t cycle = instance.phase(); cycle < slowest;
             cycle += instance.definition().every)
            ++load[cycle];
    };
    std::vector<Instance*> open;
    for (const GraphNode& node : graph.nodes()) {
        Instance& instance = *node.instance;
        if (instance.definition().every == 1) continue;
        if (instance.hasPhase()) {
            occupy(instance);
        } else {
            open.push_back(&instance);
        }
    }
    for (Instance* instance : open) {
        const std::uint32_t every = instance->definition().every;
        const auto heaviest = [&](std::uint32_t phase) {
            std::uint32_t most = 0;
            for (std::uint32_t cycle = phase; cycle < slowest; cycle += every)
                most = std::max(most, load[cycle]);
            return most;
        };
        std::uint32_t best = 0;
        for (std::uint32_t phase = 1; phase < every; ++phase) {
            if (heaviest(phase) < heaviest(best)) best = phase;
        }
        instance->setPhase(best);
        occupy(*instance);
    }
}

}  // namespace rtcf::executor

#include "ordering/order.hpp"

#include <algorithm>
#include <queue>
#include <tuple>

namespace rtcf::executor {

namespace {

// Kahn's algorithm. The result is shorter than problem.names if there are loops.
std::vector<std::size_t> kahn(const OrderProblem& problem, const std::vector<Edge>& edges) {
    const std::size_t count = problem.names.size();
    std::vector<std::size_t> waiting_for(count, 0);
    std::vector<std::vector<std::size_t>> successors(count);
    for (const Edge& edge : edges) {
        ++waiting_for[edge.to];
        successors[edge.from].push_back(edge.to);
    }
    const auto later = [&](std::size_t a, std::size_t b) {
        return std::make_tuple(!problem.first[a], problem.names[a]) >
               std::make_tuple(!problem.first[b], problem.names[b]);
    };
    std::priority_queue<std::size_t, std::vector<std::size_t>, decltype(later)> ready(later);
    for (std::size_t i = 0; i < count; ++i) {
        if (waiting_for[i] == 0) ready.push(i);
    }
    std::vector<std::size_t> order;
    order.reserve(count);
    while (!ready.empty()) {
        const std::size_t next = ready.top();
        ready.pop();
        order.push_back(next);
        for (const std::size_t successor : successors[next]) {
            if (--waiting_for[successor] == 0) ready.push(successor);
        }
    }
    return order;
}

// Finds a loop among the components that Kahn's algorithm left over. Each of them has a predecessor
// among them, so walking backwards reaches a component twice.
std::vector<Edge> findLoop(const OrderProblem& problem, const std::vector<Edge>& edges,
                           const std::vector<std::size_t>& ordered) {
    const std::size_t count = problem.names.size();
    std::vector<bool> left(count, true);
    for (const std::size_t i : ordered) left[i] = false;
    std::vector<const Edge*> into(count, nullptr);
    for (const Edge& edge : edges) {
        if (left[edge.from] && left[edge.to] && into[edge.to] == nullptr) into[edge.to] = &edge;
    }
    std::size_t at = 0;
    while (!left[at]) ++at;
    std::vector<bool> seen(count, false);
    while (!seen[at]) {
        seen[at] = true;
        at = into[at]->from;
    }
    std::vector<Edge> loop;
    const std::size_t begin = at;
    do {
        loop.push_back(*into[at]);
        at = into[at]->from;
    } while (at != begin);
    std::reverse(loop.begin(), loop.end());
    return loop;
}

bool sameInput(const Edge& a, const Edge& b) { return a.to == b.to && a.to_port == b.to_port; }

void removeInput(std::vector<Edge>& edges, const Edge& input) {
    edges.erase(std::remove_if(edges.begin(), edges.end(),
                               [&](const Edge& e) { return sameInput(e, input); }),
                edges.end());
}

// Extends `start` with one break for each remaining loop, until there is an order.
std::vector<Edge> cutFrom(const OrderProblem& problem, const Edge& start) {
    std::vector<Edge> cut{start};
    std::vector<Edge> edges = problem.edges;
    removeInput(edges, start);
    for (;;) {
        const std::vector<std::size_t> order = kahn(problem, edges);
        if (order.size() == problem.names.size()) return cut;
        cut.push_back(findLoop(problem, edges, order).back());
        removeInput(edges, cut.back());
    }
}

}  // namespace

std::vector<std::size_t> orderUpToLoops(const OrderProblem& problem) {
    return kahn(problem, problem.edges);
}

OrderResult findOrder(const OrderProblem& problem) {
    OrderResult result;
    result.order = kahn(problem, problem.edges);
    if (result.order.size() == problem.names.size()) return result;
    result.loop = findLoop(problem, problem.edges, result.order);
    result.order.clear();
    for (const Edge& edge : result.loop) result.cuts.push_back(cutFrom(problem, edge));
    return result;
}

}  // namespace rtcf::executor

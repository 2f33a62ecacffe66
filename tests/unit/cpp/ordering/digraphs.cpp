#include "ordering/digraphs.hpp"

#include <algorithm>
#include <array>
#include <numeric>

namespace rtcf::test {

namespace {

// The new position of each row and node of a graph under one renaming of the nodes.
struct Renaming {
    std::array<unsigned, kDigraphWidth> to{};
    std::array<Digraph, 1U << kDigraphWidth> row{};

    explicit Renaming(const std::vector<unsigned>& names) {
        std::copy(names.begin(), names.end(), to.begin());
        for (unsigned bits = 0; bits < row.size(); ++bits) {
            for (unsigned i = 0; i < names.size(); ++i) row[bits] |= (bits >> i & 1U) << names[i];
        }
    }

    Digraph apply(Digraph graph, unsigned nodes) const {
        Digraph renamed = 0;
        for (unsigned from = 0; from < nodes; ++from) {
            renamed |= row[graph >> (kDigraphWidth * from) & 0x1fU] << (kDigraphWidth * to[from]);
        }
        return renamed;
    }
};

std::vector<Renaming> renamingsOf(unsigned nodes) {
    std::vector<unsigned> names(nodes);
    std::iota(names.begin(), names.end(), 0U);
    std::vector<Renaming> renamings;
    do {
        renamings.emplace_back(names);
    } while (std::next_permutation(names.begin(), names.end()));
    return renamings;
}

// The smallest of all graphs that differ only in the nodes' names.
Digraph canonical(Digraph graph, unsigned nodes, const std::vector<Renaming>& renamings) {
    Digraph least = ~Digraph{0};
    for (const Renaming& renaming : renamings)
        least = std::min(least, renaming.apply(graph, nodes));
    return least;
}

}  // namespace

std::vector<Digraph> digraphsUpToIsomorphism(unsigned nodes) {
    const std::vector<Renaming> renamings = renamingsOf(nodes);
    const std::vector<Digraph> smaller =
        nodes == 1 ? std::vector<Digraph>{0} : digraphsUpToIsomorphism(nodes - 1);
    std::vector<Digraph> found;
    // Each graph is a smaller one plus a node, with any edges to the others.
    const unsigned last = nodes - 1;
    for (const Digraph base : smaller) {
        for (unsigned ways = 0; ways < 1U << (2 * last + 1); ++ways) {
            Digraph graph = base;
            for (unsigned i = 0; i < last; ++i) {
                graph |= (ways >> i & 1U) << (kDigraphWidth * last + i);
                graph |= (ways >> (last + i) & 1U) << (kDigraphWidth * i + last);
            }
            graph |= (ways >> (2 * last) & 1U) << (kDigraphWidth * last + last);
            found.push_back(canonical(graph, nodes, renamings));
        }
    }
    std::sort(found.begin(), found.end());
    found.erase(std::unique(found.begin(), found.end()), found.end());
    return found;
}

bool isAcyclic(Digraph graph, unsigned nodes) {
    unsigned left = (1U << nodes) - 1;
    for (bool removed = true; removed && left != 0;) {
        removed = false;
        for (unsigned node = 0; node < nodes; ++node) {
            if ((left >> node & 1U) == 0) continue;
            bool entered = false;
            for (unsigned from = 0; from < nodes; ++from) {
                entered = entered || ((left >> from & 1U) != 0 && hasEdge(graph, from, node));
            }
            if (!entered) {
                left &= ~(1U << node);
                removed = true;
            }
        }
    }
    return left == 0;
}

}  // namespace rtcf::test

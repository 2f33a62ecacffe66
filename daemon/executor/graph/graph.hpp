/// @file
/// The graph of a runner as a value: its components and its loop breaks. A change makes a new
/// graph; the old one stays unchanged until the loop has adopted the new one. Graph thread only.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "graph/instance.hpp"
#include "graph/loop_breaks.hpp"

namespace rtcf::executor {

struct GraphNode {
    std::shared_ptr<Instance> instance;
    LoopBreaks breaks;  ///< at first those of its definition
};

class Graph {
   public:
    const std::vector<GraphNode>& nodes() const noexcept { return nodes_; }

    /// @param full_name with namespace. @return null if there is none
    const GraphNode* find(const std::string& full_name) const noexcept;
    /// @throws Error that lists the components
    const GraphNode& get(const std::string& full_name) const;

    /// @name Changes; if one throws Error, it has changed nothing
    /// @{
    void add(GraphNode node);  ///< the name must be free
    void remove(const std::string& full_name);
    void replace(const std::string& full_name, GraphNode node);
    /// Removing a loop break that `first` or `ignore` sets replaces these by loop breaks of all
    /// other inputs that they apply to.
    void setBreak(const std::string& full_name, const std::string& port, bool broken);
    void setBreaks(const std::string& full_name, const LoopBreaks& breaks);
    /// @}

    /// Checks that a name is free, before a component is constructed.
    /// @throws Error if it is taken
    void requireFree(const std::string& full_name) const;

   private:
    std::size_t indexOf(const std::string& full_name) const;

    std::vector<GraphNode> nodes_;
};

}  // namespace rtcf::executor

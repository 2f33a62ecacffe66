/// @file
/// What the master is told of this process's node. roscpp does so once, when a
/// topic is opened or closed; this does it again for a master that has been
/// restarted, and for good at the end.
#pragma once

#include "ros/roscpp/master_client.hpp"
#include "ros/roscpp/roscpp_node.hpp"

namespace rtcf::ros1 {

/// What a master says of the node.
struct Lookup {
    enum class Kind {
        Silent,   ///< the master does not answer
        Ours,     ///< known, and its URI is ours
        Unknown,  ///< no node of that name
        Other,    ///< another node has the name
    };
    Kind kind;
    std::string uri;  ///< of the node, ours or the other
};

Lookup lookUp(MasterClient& master, const RoscppNode& node);

/// Registers all topics and services of the node and connects its
/// subscriptions to the publishers that the master names.
/// @return false if the master or the node stopped answering
bool registerAll(MasterClient& master, MasterClient& self, const RoscppNode& node);

/// Takes all registrations back; connections stay.
/// @return false if the master or the node stopped answering, or it took too long
bool withdrawAll(MasterClient& master, MasterClient& self, const RoscppNode& node,
                 std::chrono::steady_clock::time_point deadline);

}  // namespace rtcf::ros1

#include "ros/master/claim.hpp"

#include <vector>

namespace rtcf::ros1 {

namespace {

constexpr auto kCheckPeriod = std::chrono::seconds(10);

// The nodes with this topic or service.
std::vector<std::string> holders(XmlRpc::XmlRpcValue& state, int kind, const std::string& name) {
    std::vector<std::string> nodes;
    XmlRpc::XmlRpcValue& list = state[kind];
    // NOLINTBEGIN(modernize-loop-convert): its begin() is for structs
    for (int i = 0; i < list.size(); ++i) {
        if (static_cast<std::string&>(list[i][0]) != name) continue;
        XmlRpc::XmlRpcValue& having = list[i][1];
        for (int node = 0; node < having.size(); ++node)
            nodes.push_back(static_cast<std::string&>(having[node]));
    }
    // NOLINTEND(modernize-loop-convert)
    return nodes;
}

}  // namespace

const std::string& Claim::of(MasterLink& link, const std::string& wanted) {
    constexpr int kPublishers = 0;  // index in the three lists of getSystemState
    constexpr int kServices = 2;
    const std::string own = link.name().full();
    const auto now = std::chrono::steady_clock::now();
    if (wanted.empty() || wanted == own) {
        problem_.clear();
        return used_ = own;
    }
    if (wanted == wanted_ && now < next_) return used_;
    ParallelCalls master = link.calls();
    std::vector<MasterAnswer> answers = master.run(
        {{"getSystemState", texts({own})}}, kMasterAnswerTimeout, now + kMasterAnswerTimeout);
    if (!answers[0]) {
        if (used_.empty()) used_ = own;
        return used_;
    }
    // The first repetition is early: two nodes that start together may both have found the
    // namespace free.
    next_ = now + (wanted == wanted_ ? kCheckPeriod : kMasterAnswerTimeout);
    wanted_ = wanted;
    used_ = wanted;
    problem_.clear();
    for (const auto& [kind, name] :
         {std::pair{kServices, "/deactivate_rt_loop"}, std::pair{kPublishers, "/iteration_info"}}) {
        for (const std::string& node : holders(answers[0].value, kind, wanted + name)) {
            if (node == own || !link.lives(node)) continue;
            used_ = own;
            problem_ = "node " + node + " uses the names below " + wanted +
                       ": the services and iteration_info of this runner are below " + own;
        }
    }
    return used_;
}

}  // namespace rtcf::ros1

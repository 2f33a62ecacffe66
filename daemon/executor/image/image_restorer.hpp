/// @file
/// Restores an image of a runner: finds the place of each of its values in a graph, or says what
/// does not fit. Lives for one restoration; graph thread only.
#pragma once

#include <map>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "image/image.hpp"
#include "image/image_taker.hpp"
#include "ordering/plan.hpp"

namespace rtcf::executor {

class ImageRestorer {
   public:
    using Batch = std::vector<std::pair<std::string, ParameterValue>>;

    /// Finds the place of everything. @param plan that the loop has; it and `image` outlive this
    /// @throws Refusal that says what does not fit
    ImageRestorer(const RunnerImage& image, const Plan& plan);
    ImageRestorer(const ImageRestorer&) = delete;
    ImageRestorer& operator=(const ImageRestorer&) = delete;

    /// To be applied at a boundary.
    Restoration& restoration() noexcept { return restoration_; }
    /// Requires that nothing is larger than what its component has reserved. @throws Refusal
    void requireReserved() const;
    /// Parameters that are to change, and the cycles of their every() in which components run.
    const std::map<Instance*, Batch>& parameters() const noexcept { return parameters_; }
    const std::map<Instance*, std::uint32_t>& phases() const noexcept { return phases_; }
    /// After that, of the plan that the loop has now: who keeps alive what inputs refer to.
    void noteIn(Plan& plan) const;

   private:
    void fit(const ImageComponent& image, const GraphNode& node);
    void fitParameters(const ImageComponent& image, Instance& instance);
    void fitStates(const ImageComponent& image, const Instance& instance);
    void fitOutputs(const ImageComponent& image, const Instance& instance);
    void fitInputs(const ImageComponent& image, const Instance& instance);
    void fitInput(const ImageInput& image, InputBase& input, const std::string& name);
    void fitTopics();
    /// @param from what an image has, and `to` the graph, of one kind of thing that has a name
    template <typename From, typename To, typename Name, typename Fit>
    void fitEach(const std::string& of, const char* kind, const From& from, const To& to, Name name,
                 Fit fit);
    /// @param sample what has the room that the slot is to have, if any
    std::shared_ptr<SlotHeader> slotFrom(const TypeInfo& type, const ImageValue& value,
                                         const std::string& name,
                                         const SlotHeader* sample = nullptr);
    void restoreTo(SlotHeader* to, const TypeInfo& type, const ImageValue& value,
                   const std::string& name);
    void problem(std::string text) { problems_.push_back(std::move(text)); }
    void requireFit() const;
    void requireTimes() const;

    const RunnerImage& image_;
    const Plan& plan_;
    const Sources sources_;
    Restoration restoration_;
    std::vector<std::string> problems_;
    std::map<std::string, std::pair<const OutputBase*, const SlotHeader*>> outputs_;  // and samples
    std::map<const SlotHeader*, std::pair<std::string, const SlotHeader*>> reserved_;
    std::map<Instance*, Batch> parameters_;
    std::map<Instance*, std::uint32_t> phases_;
    struct Kept {
        std::shared_ptr<const SlotHeader> left;  // in the place of a source that is no more
        std::shared_ptr<const SlotHeader> kept;
    };
    std::map<InputBase*, Kept> kept_;
    std::map<const Injector*, std::vector<Restoration::Input>> readers_;
};

}  // namespace rtcf::executor

/// @file
/// Takes an image of a runner: works out what is to be copied, and makes an image of the copies.
/// Lives for one snapshot; graph thread only.
#pragma once

#include <cstddef>
#include <map>
#include <string>
#include <vector>

#include "image/image.hpp"
#include "ordering/plan.hpp"

namespace rtcf::executor {

/// The names of what feeds inputs.
class Sources {
   public:
    /// @param plan outlives this
    explicit Sources(const Plan& plan);
    /// "/C.out", "/C.out one cycle late", "topic /x"; empty = nothing feeds it.
    std::string of(const InputBase& input) const;
    /// The output whose slot this is, as "/C.out". Empty: none of the graph's.
    std::string output(const SlotHeader* slot) const;

   private:
    const Plan& plan_;
    std::map<const void*, std::string> names_;  // by slot or injector
};

class ImageTaker {
   public:
    /// @param plan that the loop has; outlives this
    explicit ImageTaker(const Plan& plan);
    ImageTaker(const ImageTaker&) = delete;
    ImageTaker& operator=(const ImageTaker&) = delete;

    /// To be filled at a boundary.
    Capture& capture() noexcept { return capture_; }
    /// Makes the room that filling it lacked.
    void makeRoom();
    /// After that. @throws Refusal if a component was taken out
    RunnerImage image() const;

   private:
    void add(const TypeInfo& type, const SlotHeader* slot, const SlotHeader* sample);
    ImageValue valueAt(const SlotHeader* slot) const;
    ImageComponent componentOf(std::size_t step) const;
    ImageInput inputOf(const InputBase& input, const InputBase::Reading& reading) const;

    const Plan& plan_;
    const Sources sources_;
    Capture capture_;
    std::map<const SlotHeader*, std::size_t> values_;  // index into capture_.values
    std::vector<std::vector<std::byte>> states_;       // by step
};

}  // namespace rtcf::executor

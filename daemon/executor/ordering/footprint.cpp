#include "ordering/footprint.hpp"

#include <cstdint>
#include <unordered_set>
#include <utility>

namespace rtcf::executor {
namespace {

class Lines {
   public:
    bool full() const { return lines_.size() >= kLargestFootprint; }

    void add(const void* begin, std::size_t bytes) {
        if (begin == nullptr) return;
        const auto* byte = static_cast<const char*>(begin);
        const char* end = byte + bytes;
        byte -= reinterpret_cast<std::uintptr_t>(byte) % kCacheLine;
        for (; byte < end && !full(); byte += kCacheLine)
            if (known_.insert(byte).second) lines_.push_back(byte);
    }

    /// Adds a slot's header and the first 8 bytes of its value.
    void addSlot(const SlotHeader* slot) { add(slot, sizeof(SlotHeader) + sizeof(double)); }

    std::vector<const void*> take() { return std::move(lines_); }

   private:
    std::vector<const void*> lines_;
    std::unordered_set<const void*> known_;
};

}  // namespace

std::vector<const void*> footprint(
    const Schedule& schedule, const std::function<const SlotHeader*(const InputPort*)>& source) {
    Lines lines;
    for (const Step& step : schedule.steps) {
        if (lines.full()) break;
        lines.add(&step, sizeof step);
        lines.add(step.component, sizeof *step.component);
        for (const InputPort* input : accessTo(*step.component).inputs()) {
            lines.add(&input->input(), sizeof(InputBase));
            lines.addSlot(source(input));
        }
        for (const OutputPort* output : accessTo(*step.component).outputs()) {
            lines.add(&output->output(), sizeof(OutputBase));
            lines.addSlot(output->slot().get());
        }
    }
    return lines.take();
}

}  // namespace rtcf::executor

#include "loop/cycle_reader.hpp"

namespace rtcf::executor {

void CycleReader::follow(const CycleFrames& frames) {
    if (!rings_.empty() && rings_.back().ring == frames.ring) return;
    rings_.push_back(frames);
    // Rings that have been read must not take memory from later ones.
    while (rings_.size() > 1 && (rings_.size() > kMostRings || waiting() == 0)) leaveRing();
}

// Goes on to the next ring; the cycles left in this one are lost.
void CycleReader::leaveRing() {
    lost_ += rings_.front().ring->end() - next_;
    rings_.pop_front();
    next_ = 0;
}

const CycleFrames* CycleReader::next(Frame& frame) {
    while (!rings_.empty()) {
        const FrameRing& ring = *rings_.front().ring;
        const std::uint64_t end = ring.end();
        if (end - next_ > ring.capacity()) {
            lost_ += end - ring.capacity() - next_;
            next_ = end - ring.capacity();
        }
        while (next_ < end) {
            if (ring.readTicks(next_++, frame)) return &rings_.front();
            ++lost_;
        }
        // If there is another ring, the loop fills this one no more.
        if (rings_.size() == 1) break;
        leaveRing();
    }
    return nullptr;
}

void CycleReader::skip() {
    if (rings_.empty()) return;
    rings_.erase(rings_.begin(), rings_.end() - 1);
    next_ = rings_.front().ring->end();
}

}  // namespace rtcf::executor

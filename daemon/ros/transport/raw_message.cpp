#include "ros/transport/raw_message.hpp"

#include <memory>
#include <new>
#include <sstream>

#include "realtime/unlocked_memory.hpp"

namespace rtcf::ros1 {

bool startsWithHeader(const std::string& definition) {
    std::istringstream lines(definition);
    std::string line;
    while (std::getline(lines, line)) {
        std::istringstream words(line.substr(0, line.find('#')));
        std::string type;
        std::string name;
        if (!(words >> type)) continue;  // blank line or comment
        words >> name;
        // Skips constants, e.g. `uint8 X=1`.
        if (line.find('=') != std::string::npos && line.find('=') < line.find('#')) {
            // A line of `=` separates the parts of a concatenated definition.
            if (type.find_first_not_of('=') == std::string::npos) return false;
            continue;
        }
        return name == "header" && (type == "Header" || type == "std_msgs/Header");
    }
    return false;
}

boost::shared_array<std::uint8_t> networkBytes(std::size_t bytes,
                                               const std::shared_ptr<void>& owner) {
    const std::shared_ptr<std::uint8_t[]> block =
        executor::UnlockedMemory::ofProcess().allocate(bytes);
    if (!block) throw std::bad_alloc();
    return {block.get(), [block, owner](const std::uint8_t* /*bytes*/) {}};
}

boost::shared_array<std::uint8_t> Departures::add(std::size_t bytes) {
    auto added = networkBytes(bytes, now_);
    if (latch_) last_ = added;
    return added;
}

Departures::Until Departures::mark() {
    Until marked = now_;
    now_ = std::make_shared<char>();
    return marked;
}

bool Departures::gone(const Until& marked) const {
    if (marked.expired()) return true;
    // A latched message stays with this object and with roscpp; when it is sent, there are no other
    // owners.
    return latch_ && marked.use_count() == 1 && last_ && last_.use_count() <= 2;
}

}  // namespace rtcf::ros1

#include "ros/roscpp/raw_message.hpp"

#include <memory>
#include <new>
#include <sstream>

#include "loop/unlocked_memory.hpp"

namespace rtcf::ros1 {

bool startsWithHeader(const std::string& definition) {
    std::istringstream lines(definition);
    std::string line;
    while (std::getline(lines, line)) {
        std::istringstream words(line.substr(0, line.find('#')));
        std::string type;
        std::string name;
        if (!(words >> type)) continue;  // blank or comment
        words >> name;
        // Constants are no fields: `uint8 X=1`.
        if (line.find('=') != std::string::npos && line.find('=') < line.find('#')) {
            // The parts of a concatenated definition are separated by a line of `=`.
            if (type.find_first_not_of('=') == std::string::npos) return false;
            continue;
        }
        return name == "header" && (type == "Header" || type == "std_msgs/Header");
    }
    return false;
}

boost::shared_array<std::uint8_t> networkBytes(std::size_t bytes) {
    const std::shared_ptr<std::uint8_t[]> block =
        executor::UnlockedMemory::ofProcess().allocate(bytes);
    if (!block) throw std::bad_alloc();
    return {block.get(), [block](const std::uint8_t* /*bytes*/) {}};
}

}  // namespace rtcf::ros1

#include "ros/roscpp/raw_message.hpp"

#include <sstream>

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

}  // namespace rtcf::ros1

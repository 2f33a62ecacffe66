#include "ros/logging/console_config.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <fstream>
#include <map>

#include "logging/log.hpp"

namespace rtcf::ros1 {

namespace {

std::string trimmed(const std::string& text) {
    const auto begin = text.find_first_not_of(" \t\r");
    if (begin == std::string::npos) return {};
    return text.substr(begin, text.find_last_not_of(" \t\r") - begin + 1);
}

}  // namespace

void applyConsoleConfig(const std::string& file, executor::Log& log) {
    static const std::map<std::string, LogLevel> levels{
        {"ALL", LogLevel::Debug},   {"TRACE", LogLevel::Debug}, {"DEBUG", LogLevel::Debug},
        {"INFO", LogLevel::Info},   {"WARN", LogLevel::Warn},   {"ERROR", LogLevel::Error},
        {"FATAL", LogLevel::Fatal}, {"OFF", LogLevel::Fatal}};
    constexpr const char* kPrefix = "log4j.logger.";
    std::ifstream stream(file);
    if (!stream) {
        log.write(
            LogLevel::Warn, {},
            fmt::format("cannot read ROSCONSOLE_CONFIG_FILE {}: log levels are unchanged", file));
        return;
    }
    std::string line;
    for (int number = 1; std::getline(stream, line); ++number) {
        line = trimmed(line);
        if (line.rfind(kPrefix, 0) != 0) continue;
        const auto equals = line.find('=');
        if (equals == std::string::npos) continue;
        const std::string logger =
            trimmed(line.substr(std::char_traits<char>::length(kPrefix),
                                equals - std::char_traits<char>::length(kPrefix)));
        // `LEVEL, appender, …`
        std::string word = trimmed(line.substr(equals + 1, line.find(',') - equals - 1));
        std::transform(word.begin(), word.end(), word.begin(),
                       [](unsigned char c) { return static_cast<char>(std::toupper(c)); });
        const auto level = levels.find(word);
        if (level != levels.end()) {
            log.levels().set(logger, level->second);
        } else if (!word.empty()) {
            log.write(
                LogLevel::Warn, {},
                fmt::format("{}:{}: '{}' is not a level: use DEBUG, INFO, WARN, ERROR or FATAL",
                            file, number, word));
        }
    }
}

}  // namespace rtcf::ros1

#include "logging/levels.hpp"

#include <algorithm>

namespace rtcf::executor {

namespace {

constexpr const char* kRoot = "ros";
constexpr const char* kComponents = "ros.rtcf";

// Converts logger names of RTCF 2021, e.g. `ros.rtcf./arm/H1` for /arm/H1, to ours.
std::string plain(const std::string& logger) {
    if (logger.find('/') == std::string::npos) return logger;
    std::string name;
    for (const char c : logger) {
        const char next = c == '/' ? '.' : c;
        if (next != '.' || (!name.empty() && name.back() != '.')) name += next;
    }
    return name;
}

}  // namespace

LogLevels::LogLevels() {
    set_[kRoot] = LogLevel::Info;
    known_.insert(kComponents);
}

std::string LogLevels::loggerOf(const std::string& component) {
    std::string logger = kComponents + component;
    std::replace(logger.begin(), logger.end(), '/', '.');
    return logger;
}

LogLevel LogLevels::find(const std::string& logger) const {
    for (std::string name = logger;; name.resize(name.rfind('.'))) {
        if (const auto found = set_.find(name); found != set_.end()) return found->second;
        if (name.find('.') == std::string::npos) return set_.at(kRoot);
    }
}

LogLevel LogLevels::of(const std::string& logger) const {
    const std::lock_guard lock(mutex_);
    return find(plain(logger));
}

void LogLevels::set(const std::string& logger, LogLevel level) {
    const std::lock_guard lock(mutex_);
    set_[plain(logger)] = level;
    for (auto& [key, component] : attached_)
        component.level->store(find(component.logger), std::memory_order_relaxed);
}

LogLevel LogLevels::lowest() const {
    const std::lock_guard lock(mutex_);
    LogLevel lowest = find(kComponents);
    for (const auto& [key, component] : attached_)
        lowest = std::min(lowest, find(component.logger));
    return lowest;
}

std::map<std::string, LogLevel> LogLevels::all() const {
    const std::lock_guard lock(mutex_);
    std::map<std::string, LogLevel> levels = set_;
    for (const std::string& logger : known_) levels.emplace(logger, find(logger));
    for (const auto& [key, component] : attached_)
        levels.emplace(component.logger, find(component.logger));
    return levels;
}

void LogLevels::know(const std::string& logger) {
    const std::lock_guard lock(mutex_);
    known_.insert(logger);
}

void LogLevels::attach(const std::string& component, std::atomic<LogLevel>& level) {
    const std::lock_guard lock(mutex_);
    const std::string logger = loggerOf(component);
    level.store(find(logger), std::memory_order_relaxed);
    attached_[&level] = {logger, &level};
}

void LogLevels::detach(const std::atomic<LogLevel>& level) {
    const std::lock_guard lock(mutex_);
    attached_.erase(&level);
}

}  // namespace rtcf::executor

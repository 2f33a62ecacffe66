#include "ros/logging/console_backend.hpp"

#include <ros/console_impl.h>

#include <algorithm>
#include <cstdlib>
#include <map>
#include <mutex>
#include <set>
#include <vector>

#include "ros/logging/console_config.hpp"
#include "ros/roscpp/hooks.hpp"

namespace rtcf::ros1 {

namespace {

// Global, because rosconsole calls functions without an object, and keeps the handles for the life
// of the process.
struct Console {
    std::mutex mutex;
    ConsoleBackend* backend = nullptr;
    std::set<std::string> loggers;  // rosconsole's handles are their addresses
    std::vector<ros::console::LogAppender*> appenders;
};

Console& console() {
    static auto* const only = new Console;  // outlives static objects of all libraries
    return *only;
}

// roscpp's own loggers are about the node, even in a component's hook.
bool isOfNode(const std::string& logger) { return logger.rfind("ros.roscpp", 0) == 0; }

const std::string& nameOf(void* handle) { return *static_cast<const std::string*>(handle); }

LogLevel levelFrom(ros::console::Level level) {
    return static_cast<LogLevel>(static_cast<int>(level) + 1);
}

ros::console::Level levelTo(LogLevel level) {
    return static_cast<ros::console::Level>(static_cast<int>(level) - 1);
}

}  // namespace

ConsoleBackend::ConsoleBackend(executor::Log& log) : log_(log) {
    // Messages for developers of roscpp.
    log_.levels().set("ros.roscpp.superdebug", LogLevel::Warn);
    if (const char* file = std::getenv("ROSCONSOLE_CONFIG_FILE"); file != nullptr && *file != '\0')
        applyConsoleConfig(file, log_);
    {
        const std::lock_guard lock(console().mutex);
        console().backend = this;
        for (const std::string& logger : console().loggers) log_.levels().know(logger);
    }
    // Call sites that have logged before have cached no level yet.
    ros::console::notifyLoggerLevelsChanged();
}

ConsoleBackend::~ConsoleBackend() {
    const std::lock_guard lock(console().mutex);
    console().backend = nullptr;
}

bool ConsoleBackend::enabled(const std::string& logger, LogLevel level) const {
    if (isOfNode(logger)) return level >= log_.levels().of(logger);
    // One call site may run in hooks of several components; print() checks the component's level.
    return level >= std::min(log_.levels().of(logger), log_.levels().lowest());
}

void ConsoleBackend::print(const std::string& logger, LogLevel level, const char* text,
                           const char* file, const char* function, int line) {
    const std::string* component = isOfNode(logger) ? nullptr : Hooks::component();
    executor::LogEntry entry;
    if (component != nullptr) entry.component = *component;
    entry.logger = component != nullptr ? executor::LogLevels::loggerOf(*component) : logger;
    if (level < log_.levels().of(entry.logger)) return;
    entry.level = level;
    entry.message = text != nullptr ? text : "";
    entry.file = file != nullptr ? file : "";
    entry.function = function != nullptr ? function : "";
    entry.line = static_cast<std::uint32_t>(line);
    log_.post(std::move(entry));
}

}  // namespace rtcf::ros1

// The interface between rosconsole and its backend. librosconsole finds these functions before
// those of its log4cxx library.
namespace ros::console::impl {

using rtcf::ros1::console;

void initialize() {}

void shutdown() {}

void register_appender(LogAppender* appender) {
    const std::lock_guard lock(console().mutex);
    console().appenders.push_back(appender);
}

void deregister_appender(LogAppender* appender) {
    const std::lock_guard lock(console().mutex);
    auto& appenders = console().appenders;
    appenders.erase(std::remove(appenders.begin(), appenders.end(), appender), appenders.end());
}

void print(void* handle, Level level, const char* str, const char* file, const char* function,
           int line) {
    const std::lock_guard lock(console().mutex);
    for (LogAppender* appender : console().appenders)
        appender->log(level, str, file, function, line);
    if (console().backend == nullptr) return;
    console().backend->print(rtcf::ros1::nameOf(handle), rtcf::ros1::levelFrom(level), str, file,
                             function, line);
}

bool isEnabledFor(void* handle, Level level) {
    const std::lock_guard lock(console().mutex);
    if (console().backend == nullptr) return level >= levels::Info;
    return console().backend->enabled(rtcf::ros1::nameOf(handle), rtcf::ros1::levelFrom(level));
}

void* getHandle(const std::string& name) {
    const std::lock_guard lock(console().mutex);
    const std::string& logger = *console().loggers.insert(name).first;
    if (console().backend != nullptr) console().backend->levels().know(logger);
    return const_cast<std::string*>(&logger);
}

std::string getName(void* handle) { return rtcf::ros1::nameOf(handle); }

bool get_loggers(std::map<std::string, levels::Level>& loggers) {
    const std::lock_guard lock(console().mutex);
    if (console().backend == nullptr) return false;
    for (const auto& [name, level] : console().backend->levels().all())
        loggers[name] = rtcf::ros1::levelTo(level);
    return true;
}

bool set_logger_level(const std::string& name, levels::Level level) {
    const std::lock_guard lock(console().mutex);
    if (console().backend == nullptr || level >= levels::Count) return false;
    console().backend->levels().set(name, rtcf::ros1::levelFrom(level));
    return true;
}

}  // namespace ros::console::impl

/// @file
/// RTCF 2021's logging macros, for member functions of components. All of them
/// work in every hook and are real-time safe if formatting their arguments is:
/// a text is formatted in a bounded buffer on the stack and stored in the log,
/// which passes it on to the journal and to ROS.
///
///     RT_INFO("ready");
///     RT_WARN_STREAM("force " << force << " N");
///     NON_RT_INFO("%d joints", joints);
#pragma once

#include <ros/console.h>  // as in RTCF 2021's header of this name

#include "rtcf/log_buffer.hpp"

/// Parent of the loggers of all components.
#define NAME_PREFIX "ros.rtcf"

/// True in updateHook(), unless the component is in error (TaskContext::error()); false in all
/// other hooks.
#define RT_ACTIVE \
    (this->isRunning() && this->getTargetState() == RTT::base::TaskCore::TaskState::Running)

/// @name Internals of the macros below
/// @{
#define RTCF_COMPAT_LOG_(log_level, format, fill_buffer)                                   \
    do {                                                                                   \
        const ::rtcf::Component& rtcf_log_self = *this;                                    \
        if (rtcf_log_self.logs(log_level)) {                                               \
            static constexpr ::rtcf::LogSite rtcf_log_site{log_level, __FILE__, __LINE__,  \
                                                           RTCF_LOG_FUNCTION_, format};    \
            ::rtcf::rtt_compat::LogBuffer rtcf_log_buffer;                                 \
            fill_buffer;                                                                   \
            ::rtcf::rtt_compat::log(rtcf_log_self, rtcf_log_site, rtcf_log_buffer.text()); \
        }                                                                                  \
    } while (false)
#define RTCF_COMPAT_TEXT_(log_level, text) \
    RTCF_COMPAT_LOG_(log_level, "{}", ::rtcf::rtt_compat::fill(rtcf_log_buffer, text))
#define RTCF_COMPAT_PRINT_(log_level, ...) \
    RTCF_COMPAT_LOG_(log_level, "{}", ::rtcf::rtt_compat::print(rtcf_log_buffer, __VA_ARGS__))
#define RTCF_COMPAT_STREAM_(log_level, arguments)          \
    RTCF_COMPAT_LOG_(log_level, "{}", {                    \
        std::ostream rtcf_log_stream(&rtcf_log_buffer);    \
        rtcf_log_stream << arguments; /* NOLINT: a list */ \
    })
/// @}

/// @name Log a text verbatim; real-time safe
/// @{
#define RT_DEBUG(text) RTCF_COMPAT_TEXT_(::rtcf::LogLevel::Debug, text)
#define RT_INFO(text) RTCF_COMPAT_TEXT_(::rtcf::LogLevel::Info, text)
#define RT_WARN(text) RTCF_COMPAT_TEXT_(::rtcf::LogLevel::Warn, text)
#define RT_ERROR(text) RTCF_COMPAT_TEXT_(::rtcf::LogLevel::Error, text)
#define RT_FATAL(text) RTCF_COMPAT_TEXT_(::rtcf::LogLevel::Fatal, text)
/// @}

/// @name Log the text of a std::ostream; real-time safe if the operators are
/// @{
#define RT_DEBUG_STREAM(arguments) RTCF_COMPAT_STREAM_(::rtcf::LogLevel::Debug, arguments)
#define RT_INFO_STREAM(arguments) RTCF_COMPAT_STREAM_(::rtcf::LogLevel::Info, arguments)
#define RT_WARN_STREAM(arguments) RTCF_COMPAT_STREAM_(::rtcf::LogLevel::Warn, arguments)
#define RT_ERROR_STREAM(arguments) RTCF_COMPAT_STREAM_(::rtcf::LogLevel::Error, arguments)
#define RT_FATAL_STREAM(arguments) RTCF_COMPAT_STREAM_(::rtcf::LogLevel::Fatal, arguments)
/// @}

/// @name Log like std::printf, and like the stream macros above
/// RTCF 2021 throws if a component uses these macros in the loop. Here they are as real-time safe
/// as those above.
/// @{
#define NON_RT_DEBUG(...) RTCF_COMPAT_PRINT_(::rtcf::LogLevel::Debug, __VA_ARGS__)
#define NON_RT_INFO(...) RTCF_COMPAT_PRINT_(::rtcf::LogLevel::Info, __VA_ARGS__)
#define NON_RT_WARN(...) RTCF_COMPAT_PRINT_(::rtcf::LogLevel::Warn, __VA_ARGS__)
#define NON_RT_ERROR(...) RTCF_COMPAT_PRINT_(::rtcf::LogLevel::Error, __VA_ARGS__)
#define NON_RT_FATAL(...) RTCF_COMPAT_PRINT_(::rtcf::LogLevel::Fatal, __VA_ARGS__)
#define NON_RT_DEBUG_STREAM(arguments) RT_DEBUG_STREAM(arguments)
#define NON_RT_INFO_STREAM(arguments) RT_INFO_STREAM(arguments)
#define NON_RT_WARN_STREAM(arguments) RT_WARN_STREAM(arguments)
#define NON_RT_ERROR_STREAM(arguments) RT_ERROR_STREAM(arguments)
#define NON_RT_FATAL_STREAM(arguments) RT_FATAL_STREAM(arguments)
/// @}

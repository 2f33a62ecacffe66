#include "messages/settings_messages.hpp"
#include "common/error.hpp"

#include <fmt/format.h>

namespace rtcf::executor {

namespace pb = ::rtcf::v1;

namespace {

constexpr std::uint32_t kKilo = 1024;

Right rightFrom(pb::Right right) {
    switch (right) {
        case pb::RIGHT_OBSERVE:
            return Right::Observe;
        case pb::RIGHT_TUNE:
            return Right::Tune;
        case pb::RIGHT_OPERATE:
            return Right::Operate;
        case pb::RIGHT_ADMIN:
            return Right::Admin;
        default:
            return Right::None;
    }
}

pb::Right rightTo(Right right) {
    switch (right) {
        case Right::None:
            break;
        case Right::Observe:
            return pb::RIGHT_OBSERVE;
        case Right::Tune:
            return pb::RIGHT_TUNE;
        case Right::Operate:
            return pb::RIGHT_OPERATE;
        case Right::Admin:
            return pb::RIGHT_ADMIN;
    }
    return pb::RIGHT_NONE;
}

OverrunPolicy overrunFrom(pb::OverrunPolicy policy) {
    if (policy == pb::OVERRUN_POLICY_CATCH_UP) return OverrunPolicy::CatchUp;
    if (policy == pb::OVERRUN_POLICY_RELATIVE) return OverrunPolicy::Relative;
    return OverrunPolicy::Skip;
}

SimTime simTimeFrom(pb::SimTime choice) {
    switch (choice) {
        case pb::SIM_TIME_NEVER:
            return SimTime::Never;
        case pb::SIM_TIME_ALWAYS:
            return SimTime::Always;
        default:
            return SimTime::Auto;
    }
}

pb::SimTime simTimeTo(SimTime choice) {
    switch (choice) {
        case SimTime::Never:
            return pb::SIM_TIME_NEVER;
        case SimTime::Always:
            return pb::SIM_TIME_ALWAYS;
        case SimTime::Auto:
            break;
    }
    return pb::SIM_TIME_AUTO;
}

pb::OverrunPolicy overrunTo(OverrunPolicy policy) {
    if (policy == OverrunPolicy::CatchUp) return pb::OVERRUN_POLICY_CATCH_UP;
    if (policy == OverrunPolicy::Relative) return pb::OVERRUN_POLICY_RELATIVE;
    return pb::OVERRUN_POLICY_SKIP;
}

}  // namespace

AccessRules rulesFrom(const v1::AccessRules& message) {
    AccessRules rules;
    rules.others = rightFrom(message.others());
    for (const auto& entry : message.users()) rules.users[entry.id()] = rightFrom(entry.right());
    for (const auto& entry : message.groups()) rules.groups[entry.id()] = rightFrom(entry.right());
    if (message.has_door_group()) rules.door_group = message.door_group();
    rules.door_open = message.door_open();
    return rules;
}

RunnerSettings settingsFrom(const pb::RunnerSettings& message, RunnerSettings base) {
    if (message.has_frequency_hz()) base.frequency_hz = message.frequency_hz();
    RealtimeSettings& realtime = base.loop.realtime;
    if (message.has_cpu()) realtime.cpu = message.cpu();
    if (message.has_priority()) realtime.priority = message.priority();
    if (message.has_spin_us()) base.loop.spin_ns = std::int64_t{message.spin_us()} * 1000;
    if (message.has_realtime() && message.realtime() != pb::REALTIME_UNSPECIFIED) {
        base.realtime_required = message.realtime() == pb::REALTIME_REQUIRED;
    }
    if (message.has_overrun()) base.loop.overrun = overrunFrom(message.overrun());
    if (message.has_max_overruns()) base.loop.max_overruns = message.max_overruns();
    if (message.has_lock_memory()) realtime.lock_memory = message.lock_memory();
    if (message.has_heap_kb()) realtime.heap_bytes = std::size_t{message.heap_kb()} * kKilo;
    if (message.has_stack_kb()) realtime.stack_bytes = std::size_t{message.stack_kb()} * kKilo;
    if (message.has_warmup_cycles()) base.loop.warmup_cycles = message.warmup_cycles();
    if (message.has_stall_timeout_ms())
        base.stall_timeout_ns = std::int64_t{message.stall_timeout_ms()} * 1'000'000;
    if (message.has_hook_timeout_s())
        base.hook_timeout_ns = static_cast<std::int64_t>(message.hook_timeout_s() * 1e9);
    if (message.has_orphan_timeout_s()) {
        base.orphan_timeout_ns = static_cast<std::int64_t>(message.orphan_timeout_s() * 1e9);
    }
    if (message.has_spin_auto()) base.spin_auto = message.spin_auto();
    if (message.has_on_boot()) base.on_boot = message.on_boot();
    if (message.has_on_crash()) base.on_crash = message.on_crash();
    if (message.has_frame_kb()) base.frame_bytes = std::size_t{message.frame_kb()} * kKilo;
    if (message.has_log_limit()) base.log_limit = message.log_limit();
    if (message.has_sim_time()) base.sim_time = simTimeFrom(message.sim_time());
    if (message.has_max_clock_jump_s()) {
        base.max_clock_jump_ns = static_cast<std::int64_t>(message.max_clock_jump_s() * 1e9);
    }
    const pb::RosSettings& ros = message.ros();
    if (ros.has_enabled()) base.bridge.enabled = ros.enabled();
    if (ros.has_master_uri()) base.bridge.master_uri = ros.master_uri();
    if (ros.has_hostname()) base.bridge.hostname = ros.hostname();
    if (ros.has_ns()) base.bridge.name_space = ros.ns();
    if (ros.has_queue()) base.bridge.queue = ros.queue();
    if (ros.has_latch()) base.bridge.latch = ros.latch();
    if (ros.has_decimation()) base.bridge.decimation = ros.decimation();
    if (ros.has_decimate()) base.bridge.decimate = ros.decimate();
    if (ros.has_stamped()) base.bridge.stamped = ros.stamped();
    if (ros.has_largest_message_kb()) {
        // Clamped to avoid an overflow; the result is out of range anyway.
        base.bridge.largest_message =
            std::min(ros.largest_message_kb(), UINT32_MAX / 1024) * std::uint32_t{1024};
    }
    if (ros.has_peers() && ros.peers() != pb::RIGHT_UNSPECIFIED)
        base.bridge.peers = rightFrom(ros.peers());
    if (ros.has_refuse_out_of_range()) base.bridge.refuse_out_of_range = ros.refuse_out_of_range();
    if (ros.has_whitelist()) base.whitelist = ros.whitelist();
    if (ros.has_blacklist()) base.blacklist = ros.blacklist();
    return base;
}

pb::RunnerSettings settingsTo(const RunnerSettings& settings) {
    pb::RunnerSettings message;
    message.set_frequency_hz(settings.frequency_hz);
    message.set_cpu(settings.loop.realtime.cpu);
    message.set_priority(settings.loop.realtime.priority);
    message.set_spin_us(static_cast<std::uint32_t>(settings.loop.spin_ns / 1000));
    message.set_realtime(settings.realtime_required ? pb::REALTIME_REQUIRED
                                                    : pb::REALTIME_PREFERRED);
    message.set_overrun(overrunTo(settings.loop.overrun));
    message.set_max_overruns(settings.loop.max_overruns);
    message.set_lock_memory(settings.loop.realtime.lock_memory);
    message.set_heap_kb(static_cast<std::uint32_t>(settings.loop.realtime.heap_bytes / kKilo));
    message.set_stack_kb(static_cast<std::uint32_t>(settings.loop.realtime.stack_bytes / kKilo));
    message.set_warmup_cycles(static_cast<std::uint32_t>(settings.loop.warmup_cycles));
    message.set_stall_timeout_ms(static_cast<std::uint32_t>(settings.stall_timeout_ns / 1'000'000));
    message.set_hook_timeout_s(static_cast<double>(settings.hook_timeout_ns) / 1e9);
    message.set_orphan_timeout_s(static_cast<double>(settings.orphan_timeout_ns) / 1e9);
    message.set_spin_auto(settings.spin_auto);
    message.set_on_boot(static_cast<pb::OnBoot>(settings.on_boot));
    message.set_on_crash(static_cast<pb::OnCrash>(settings.on_crash));
    message.set_frame_kb(static_cast<std::uint32_t>(settings.frame_bytes / kKilo));
    message.set_log_limit(settings.log_limit);
    message.set_sim_time(simTimeTo(settings.sim_time));
    message.set_max_clock_jump_s(static_cast<double>(settings.max_clock_jump_ns) / 1e9);
    pb::RosSettings& ros = *message.mutable_ros();
    ros.set_enabled(settings.bridge.enabled);
    ros.set_master_uri(settings.bridge.master_uri);
    ros.set_hostname(settings.bridge.hostname);
    ros.set_ns(settings.bridge.name_space);
    ros.set_queue(settings.bridge.queue);
    ros.set_latch(settings.bridge.latch);
    ros.set_decimation(settings.bridge.decimation);
    ros.set_decimate(settings.bridge.decimate);
    ros.set_stamped(settings.bridge.stamped);
    ros.set_largest_message_kb(settings.bridge.largest_message / 1024);
    ros.set_peers(rightTo(settings.bridge.peers));
    ros.set_refuse_out_of_range(settings.bridge.refuse_out_of_range);
    ros.set_whitelist(settings.whitelist);
    ros.set_blacklist(settings.blacklist);
    return message;
}

}  // namespace rtcf::executor

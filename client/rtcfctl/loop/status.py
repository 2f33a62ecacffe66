"""`rtcfctl status`."""

import argparse
from typing import Any

import rtcf
from rtcf.v1 import runner_pb2

from rtcfctl.terminal.output import Output
from rtcfctl.terminal.plain import enumerator
from rtcfctl.terminal.words import counted, losses

STYLES = {
    runner_pb2.RUNNER_STATE_RUNNING: "green",
    runner_pb2.RUNNER_STATE_DOWN: "bold red",
    runner_pb2.RUNNER_STATE_FAULTED: "bold red",
    runner_pb2.RUNNER_STATE_STUCK: "bold red",
}


def register(verbs: Any, common: argparse.ArgumentParser) -> None:
    """Add the verb."""
    status = verbs.add_parser(
        "status", parents=[common], help="show the state of rtcfd and its runners"
    )
    status.set_defaults(run=show)


def show(client: rtcf.Client, args: argparse.Namespace, output: Output) -> None:
    """Print the status of rtcfd and of all runners, or of the selected one."""
    response = client.get_status(args.runner)
    if not output.for_people:
        output.data(response)
        return
    up_s = response.uptime_ns // 1_000_000_000
    hours, minutes, seconds = up_s // 3600, up_s // 60 % 60, up_s % 60
    output.line(
        f"rtcfd {response.version} (pid {response.pid}), up {hours}:{minutes:02}:{seconds:02}"
    )
    for note in response.notes:
        output.line(f"rtcfd: {note}", "yellow")
    for runner in response.runners:
        output.alarm(runner.runner, runner.degraded)
        if runner.late:
            output.line(f"!! {runner.runner} IS LATE: {runner.late}", "bold red")
    print_runners(list(response.runners), output)
    for runner in response.runners:
        _details(runner, output)


def print_runners(runners: list[runner_pb2.RunnerStatus], output: Output) -> None:
    """Print a table of runners, and a line for each CPU that runners share."""
    numbers = ("Hz", "CPU", "prio", "components", "iteration", "overruns", "missed", "pid")
    output.table(
        ("runner", "state", *numbers),
        (
            (
                runner.runner,
                (
                    enumerator(runner, "state") + ", simulated" * runner.simulated,
                    STYLES.get(runner.state, ""),
                ),
                f"{runner.settings.frequency_hz:g}",
                _cpu(runner),
                runner.settings.priority,
                runner.components,
                runner.iteration,
                runner.overruns,
                runner.missed,
                runner.pid or "-",
            )
            for runner in runners
        ),
        right=numbers,
    )
    for line in shared_cpus(runners):
        output.line(line, "yellow")


def shared_cpus(runners: list[runner_pb2.RunnerStatus]) -> list[str]:
    """Return a line for each CPU that has several loops."""
    lines: dict[int, str] = {}
    for runner in runners:
        if not runner.shares_cpu_with:
            continue
        loops = {each.runner: each.priority for each in runner.shares_cpu_with}
        loops[runner.runner] = runner.settings.priority
        order = sorted(loops, key=lambda name: (-loops[name], name))
        names = ", ".join(f"{name} (priority {loops[name]})" for name in order)
        if len(set(loops.values())) == len(loops):
            says = "each loop runs before the loops after it"
        else:
            says = (
                "loops of equal priority delay each other; "
                "use `rtcfctl runner set NAME --cpu N` or `--priority N`"
            )
        lines[runner.loop_cpu] = f"CPU {runner.loop_cpu} has several loops, {names}: {says}"
    return [lines[cpu] for cpu in sorted(lines)]


def _details(runner: runner_pb2.RunnerStatus, output: Output) -> None:
    """Print status lines that are not in the table."""
    if runner.status:
        output.line(f"{runner.runner}: {runner.status}", "yellow")
    if runner.clock_silence:
        output.line(f"{runner.runner}: {runner.clock_silence}", "yellow")
    if runner.faults:
        output.line(
            f"{runner.runner}: {counted(runner.faults, 'fault')} of components since its loop "
            "started: see `rtcfctl list`",
            "yellow",
        )
    if runner.incident:
        output.line(
            f"{runner.runner}: its newest incident: `rtcfctl incident show {runner.incident}`"
        )
    for library in runner.libraries_changed:
        output.line(
            f"{runner.runner}: {library} has changed since its components were loaded: "
            "`rtcfctl list` shows them, `rtcfctl replace NAME --rebuilt` loads the new file",
            "yellow",
        )
    if runner.holder:
        output.line(f"{runner.runner}: held by {runner.holder}")
    ros = runner.ros
    if ros.enabled:
        state = (
            f"registered at {ros.master_uri}, "
            f"{ros.publications} topics published, {ros.subscriptions} subscribed"
            + (f", {ros.passed_over} unread messages replaced" * bool(ros.passed_over))
            if ros.connected
            else f"no master at {ros.master_uri}"
        )
        output.line(f"{runner.runner}: ROS node {ros.node}: {state}")
    if ros.problem:
        output.line(f"{runner.runner}: ROS: {ros.problem}", "yellow")
    if ros.too_large:
        output.line(
            f"{runner.runner}: {ros.too_large} messages dropped: larger than "
            f"{runner.settings.ros.largest_message_kb} KiB; raise the limit with "
            "`rtcfctl runner set --largest-message`",
            "yellow",
        )
    for line in losses(runner.log_dropped, runner.tap_dropped):
        output.line(f"{runner.runner}: {line}", "yellow")


def _cpu(runner: runner_pb2.RunnerStatus) -> str:
    if runner.HasField("loop_cpu"):
        return str(runner.loop_cpu)
    return "free" if runner.settings.cpu < 0 else str(runner.settings.cpu)

"""`rtcfctl doctor`: what stands between this machine and real time."""

import argparse
import os
import time
from typing import Any

import rtcf
from rtcf.diagnosis import Finding, Grade, Host, Loop, diagnose, last_cpu_of
from rtcf.v1 import runner_pb2

from rtcfctl.output import Output

_SECONDS = 10.0
_FREQUENCY_HZ = 1000.0
# Of wake-up latency, µs: what a loop of 1 kHz notices, and what it cannot live with.
_GOOD_US = 100.0
_STYLES = {Grade.GOOD: "green", Grade.UNKNOWN: "", Grade.WARNING: "yellow", Grade.BAD: "bold red"}


def register(verbs: Any, common: argparse.ArgumentParser) -> None:
    """Add the verb."""
    doctor = verbs.add_parser(
        "doctor", parents=[common], help="what stands between this machine and real time"
    )
    doctor.add_argument(
        "--seconds",
        type=float,
        default=_SECONDS,
        metavar="S",
        help="how long to measure wake-up latency; 0: not at all (default: 10)",
    )
    doctor.set_defaults(run=run)


def run(client: rtcf.Client, args: argparse.Namespace, output: Output) -> None:
    """Look, measure, judge."""
    if not 0.0 <= args.seconds <= 3600.0:
        raise ValueError(f"--seconds {args.seconds:g}: use 0 to 3600")
    host = Host()
    status, trouble = _status(client, args.runner)
    loop = _loop(host, status)
    findings = [*_of_rtcfd(status, trouble), *diagnose(host, loop)]
    latency: runner_pb2.Distribution | None = None
    if args.seconds and status is not None:
        latency, why_not = _measure(client, status, args.seconds, output)
        findings.append(_judge(latency, why_not, args.seconds))
    else:
        why_not = "rtcfd does not answer" if args.seconds else "--seconds 0"
        findings.append(Finding("wake-up latency", Grade.UNKNOWN, f"not measured: {why_not}"))
    _print(findings, latency, output)


def _status(client: rtcf.Client, runner: str) -> tuple[runner_pb2.RunnerStatus | None, str]:
    try:
        return client.get_status(runner or "rt_runner").runners[0], ""
    except rtcf.RtcfError as error:
        return None, str(error)


def _loop(host: Host, status: runner_pb2.RunnerStatus | None) -> Loop:
    if status is None:
        return Loop(max(os.sched_getaffinity(0)), 80)
    cpu = int(status.settings.cpu)
    if cpu < 0:
        cpu = next(
            (found for pid in (status.pid, os.getpid())
             if (found := last_cpu_of(host, pid)) is not None),
            0,
        )  # fmt: skip
    return Loop(cpu, status.settings.priority, status.pid, status.settings.lock_memory)


def _of_rtcfd(status: runner_pb2.RunnerStatus | None, trouble: str) -> list[Finding]:
    """Say what rtcfd itself says."""
    if status is None:
        return [Finding("rtcfd", Grade.BAD, trouble, "it serves", "systemctl start rtcfd")]
    lines = [str(line) for line in status.degraded]
    if lines:
        text = "; ".join(lines)
        return [Finding(f"runner {status.runner}", Grade.WARNING, f"degraded: {text}", "real time")]
    found = f"serves; its loop is {runner_pb2.RunnerState.Name(status.state)[13:].lower()}"
    return [Finding(f"runner {status.runner}", Grade.GOOD, found)]


def _measure(
    client: rtcf.Client, status: runner_pb2.RunnerStatus, seconds: float, output: Output
) -> tuple[runner_pb2.Distribution | None, str]:
    """Run an empty loop beside the others, as they are run, and return its wake-up latency."""
    name = f"doctor_{os.getpid()}"
    settings = runner_pb2.RunnerSettings(
        frequency_hz=_FREQUENCY_HZ,
        cpu=status.settings.cpu,
        priority=status.settings.priority,
        realtime=runner_pb2.REALTIME_PREFERRED,
        ros=runner_pb2.RosSettings(enabled=False),
    )
    output.progress(f"measuring wake-up latency for {seconds:g} s with runner {name}")
    try:
        client.add_runner(name, settings)
        try:
            client.start(name)
            time.sleep(seconds)
            latency = client.get_statistics(name).latency
        finally:
            client.remove_runner(name)
    except rtcf.RtcfError as error:
        return None, str(error)
    return latency, ""


def _judge(latency: runner_pb2.Distribution | None, why_not: str, seconds: float) -> Finding:
    topic = "wake-up latency"
    if latency is None:
        return Finding(topic, Grade.UNKNOWN, f"not measured: {why_not}")
    worst_us = latency.max_ns / 1000
    found = (
        f"{latency.p50_ns / 1000:.1f} µs median, {latency.p999_ns / 1000:.1f} µs p99.9, "
        f"{worst_us:.1f} µs worst of {latency.count} cycles in {seconds:g} s"
    )
    if worst_us <= _GOOD_US:
        return Finding(topic, Grade.GOOD, found)
    grade = Grade.WARNING if worst_us <= 1e6 / _FREQUENCY_HZ else Grade.BAD
    return Finding(topic, grade, found, f"below {_GOOD_US:g} µs", "mend what is named above first")


def verdict(findings: list[Finding]) -> tuple[Grade, str]:
    """Return the worst grade and what it means, in a line."""
    bad = [each.topic for each in findings if each.grade == Grade.BAD]
    warned = [each.topic for each in findings if each.grade == Grade.WARNING]
    if bad:
        return Grade.BAD, f"this machine is not real time: {', '.join(bad)}"
    if warned:
        return Grade.WARNING, f"real time with weak points: {', '.join(warned)}"
    return Grade.GOOD, "this machine is fit for real time"


def _print(
    findings: list[Finding], latency: runner_pb2.Distribution | None, output: Output
) -> None:
    grade, sentence = verdict(findings)
    if not output.for_people:
        document: dict[str, Any] = {
            "verdict": {"grade": grade.name.lower(), "text": sentence},
            "findings": [
                {
                    "topic": each.topic,
                    "grade": each.grade.name.lower(),
                    "found": each.found,
                    "wanted": each.wanted,
                    "remedy": each.remedy,
                }
                for each in findings
            ],
        }
        if latency is not None:
            document["latency"] = {
                "count": latency.count,
                "p50_ns": latency.p50_ns,
                "p999_ns": latency.p999_ns,
                "max_ns": latency.max_ns,
            }
        output.data(document)
        return
    for each in findings:
        output.line(f"{each.grade.name.lower():<8} {each.topic}: {each.found}", _STYLES[each.grade])
        if each.wanted and each.grade != Grade.GOOD:
            output.line(f"{'':<8} should be: {each.wanted}")
        if each.remedy and each.grade != Grade.GOOD:
            output.line(f"{'':<8} mend it:   {each.remedy}")
    output.line(sentence, _STYLES[grade])

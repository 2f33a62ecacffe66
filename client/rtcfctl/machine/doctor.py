"""`rtcfctl doctor`: checks everything that keeps a machine from real time."""

import argparse
import os
import re
import time
import uuid
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import rtcf
from rtcf.diagnosis import Finding, Grade, Host, Loop, cpu_of_next_loop, diagnose, disk
from rtcf.recording.files import LEAST_FREE_MIB
from rtcf.v1 import control_pb2, runner_pb2
from rtcf_shared.enums import word

from rtcfctl.terminal.output import Output
from rtcfctl.terminal.words import amount, counted

_SECONDS = 10.0
_FREQUENCY_HZ = 1000.0
# Largest good wake-up latency; up to the period of 1 kHz is a warning, more is bad.
_GOOD_US = 100.0
# Exit codes of doctor, besides 0 to 3, which all verbs have.
WEAK, UNFIT = 4, 5
_EXIT_CODES = {Grade.GOOD: 0, Grade.UNKNOWN: 0, Grade.WARNING: WEAK, Grade.BAD: UNFIT}
_STYLES = {Grade.GOOD: "green", Grade.UNKNOWN: "", Grade.WARNING: "yellow", Grade.BAD: "bold red"}


def register(verbs: Any, common: argparse.ArgumentParser) -> None:
    """Add the verb."""
    doctor = verbs.add_parser(
        "doctor", parents=[common], help="check everything that keeps this machine from real time"
    )
    doctor.add_argument(
        "--seconds",
        type=amount("s"),
        default=_SECONDS,
        metavar="S",
        help="measure the wake-up latency for S seconds; 0: do not (default: 10)",
    )
    doctor.set_defaults(run=run)


def run(client: rtcf.Client, args: argparse.Namespace, output: Output) -> int:
    """Check the machine, measure the latency, print the findings; return the exit code."""
    if not 0.0 <= args.seconds <= 3600.0:
        raise ValueError(f"--seconds {args.seconds:g}: use 0 to 3600")
    host = Host()
    found = _ask(client, args.runner)
    status = found.runner
    loop = _loop(host, found)
    findings = [*_of_rtcfd(found), *_of_incidents(client, found), *diagnose(host, loop)]
    findings.append(_of_recordings())
    latency = _Latency(why_not="rtcfd does not answer" if args.seconds else "--seconds 0")
    if args.seconds and status is not None:
        latency = _measure(client, host, found, loop.cpu, args.seconds, output)
    findings.append(_judge(latency))
    return report(findings, latency.distribution, output)


@dataclass(frozen=True)
class _Answer:
    """The answer of rtcfd, or the reason for none."""

    runner: runner_pb2.RunnerStatus | None = None  # the selected runner
    every: Sequence[runner_pb2.RunnerStatus] = ()
    notes: Sequence[str] = ()  # notes on rtcfd itself
    error: rtcf.RtcfError | None = None

    @property
    def keeps_silent(self) -> bool:
        """Whether rtcfd may work but does not answer us, e.g. because of missing rights."""
        if isinstance(self.error, rtcf.DaemonUnreachableError):
            return self.error.denied
        return self.error is not None


def _ask(client: rtcf.Client, name: str) -> _Answer:
    try:
        (runner,) = client.get_status(name or "rt_runner").runners
        response = client.get_status()
    except rtcf.RtcfError as error:
        if isinstance(error, rtcf.RefusedError) and error.code == "NOT_FOUND":
            raise  # there is no such runner
        return _Answer(error=error)
    return _Answer(runner, list(response.runners), list(response.notes))


def _loop(host: Host, found: _Answer) -> Loop:
    status = found.runner
    if status is None:
        cpu = max(os.sched_getaffinity(0))
        return Loop(cpu=cpu, priority=80, hidden=found.keeps_silent)
    return Loop(
        cpu=_cpu_of(host, status, found.every),
        priority=status.settings.priority,
        pid=status.pid,
        lock_memory=status.settings.lock_memory,
    )


def _of_rtcfd(found: _Answer) -> list[Finding]:
    """Return the findings that rtcfd itself reports."""
    if found.error is not None:
        text = str(found.error)
        if found.keeps_silent:  # the message names the missing rights
            return [Finding("rtcfd", Grade.UNKNOWN, text, "the right to observe")]
        return [Finding("rtcfd", Grade.BAD, text, "it answers", "systemctl start rtcfd")]
    assert found.runner is not None
    status, topic = found.runner, f"runner {found.runner.runner}"
    findings = [Finding("rtcfd", Grade.WARNING, note, "no notes") for note in found.notes]
    if lines := [str(line) for line in status.degraded]:
        text = "; ".join(lines)
        findings.append(Finding(topic, Grade.WARNING, f"degraded: {text}", "real time"))
    notes = [note for note in (status.status, status.clock_silence) if note]
    findings += [Finding(topic, Grade.WARNING, note, "no notes") for note in notes]
    if problem := status.ros.problem:
        findings.append(Finding(f"ROS node of {topic}", Grade.WARNING, problem, "no notes"))
    if not status.degraded and not notes:
        state = word(runner_pb2.RunnerState.DESCRIPTOR, status.state)
        text = f"answers; its loop is {state}"
        findings.append(Finding(topic, Grade.GOOD, text))
    return findings


def _of_incidents(client: rtcf.Client, found: _Answer) -> list[Finding]:
    """Return the finding on incidents of all runners that nobody has read."""
    if found.runner is None:
        return []
    try:
        unseen = [each for each in client.list_incidents() if not each.seen]
    except rtcf.RtcfError as error:
        return [Finding("incidents", Grade.UNKNOWN, str(error))]
    if not unseen:
        return [Finding("incidents", Grade.GOOD, "none that nobody has looked at")]
    newest = unseen[-1]
    return [
        Finding(
            "incidents",
            Grade.WARNING,
            f"{counted(len(unseen), 'incident')} that nobody has looked at; the newest: "
            f"{newest.reason or newest.name}",
            "looked at, or removed",
            f"rtcfctl incident show {newest.name}",
        )
    ]


def _of_recordings() -> Finding:
    """Return the finding on the disk of the current folder, where recordings are written."""
    floor = f"; rtcfctl record ends at {LEAST_FREE_MIB} MiB"
    topic = "disk of recordings"
    try:
        return disk(topic, Path.cwd(), "remove files, or use another disk", note=floor)
    except OSError as error:  # the folder has been removed
        return Finding(topic, Grade.UNKNOWN, str(error))


@dataclass(frozen=True)
class _Latency:
    """The measured wake-up latency, or the reason for no measurement."""

    distribution: runner_pb2.Distribution | None = None
    of: str = ""  # description of the measured loop
    why_not: str = ""


def _measure(
    client: rtcf.Client,
    host: Host,
    found: _Answer,
    cpu: int,
    seconds: float,
    output: Output,
) -> _Latency:
    """Return the wake-up latency of the loop if it runs, else of an empty loop on its CPU.

    If another loop runs on that CPU, do not measure: the two loops would delay each other.
    """
    status = found.runner
    assert status is not None
    try:
        if _runs(status):
            latency = client.get_statistics(status.runner).latency
            return _Latency(latency, f"of the running loop, {latency.count} cycles")
        for other in found.every:
            if _runs(other) and _cpu_of(host, other, found.every) == cpu:
                return _Latency(why_not=f"the loop of {other.runner} runs on CPU {cpu}")
        return _Latency(
            _of_an_empty_loop(client, status, cpu, seconds, output),
            f"on CPU {cpu} at priority {status.settings.priority} in {seconds:g} s",
        )
    except rtcf.RtcfError as error:
        return _Latency(why_not=str(error))


def _of_an_empty_loop(
    client: rtcf.Client,
    status: runner_pb2.RunnerStatus,
    cpu: int,
    seconds: float,
    output: Output,
) -> runner_pb2.Distribution:
    """Run an empty loop under a lease, so that rtcfd removes it if this process dies."""
    name = f"doctor_{os.getpid()}"
    settings = runner_pb2.RunnerSettings(
        frequency_hz=_FREQUENCY_HZ,
        cpu=cpu,
        priority=status.settings.priority,
        realtime=runner_pb2.REALTIME_PREFERRED,
        ros=runner_pb2.RosSettings(enabled=False),
    )
    output.progress(f"measuring wake-up latency for {seconds:g} s with runner {name}")
    token = f"{name}-{uuid.uuid4()}"
    hold = client.hold_runner(
        control_pb2.OpenHold(
            runner=name,
            settings=settings,
            holder=f"rtcfctl doctor (pid {os.getpid()})",
            token=token,
        )
    )
    messages = iter(hold)
    next(each for each in messages if each.WhichOneof("kind") == "taken")
    try:
        client.start(name)
        time.sleep(seconds)
        return client.get_statistics(name).latency
    finally:
        hold.end()
        for _ in messages:  # until rtcfd has removed the runner
            pass


def _runs(status: runner_pb2.RunnerStatus) -> bool:
    return bool(status.state == runner_pb2.RUNNER_STATE_RUNNING)


def _cpu_of(
    host: Host, status: runner_pb2.RunnerStatus, every: Sequence[runner_pb2.RunnerStatus]
) -> int:
    """Return the CPU of a runner's real-time thread.

    If it has none, return the CPU that rtcfd would choose, given the loops of `every` runner.
    """
    thread = f"/proc/{status.pid}/task/{status.realtime_tid}/status"
    found = re.search(r"^Cpus_allowed_list:\s*(\d+)$", host.read(thread) or "", re.MULTILINE)
    if status.realtime_tid and found:
        return int(found[1])
    if status.settings.cpu >= 0:
        return int(status.settings.cpu)
    taken = [each.loop_cpu for each in every if each.HasField("loop_cpu")]
    known = (cpu_of_next_loop(host, pid, taken) for pid in (status.pid, os.getpid()))
    return next((cpu for cpu in known if cpu is not None), 0)


def _judge(latency: _Latency) -> Finding:
    topic, distribution = "wake-up latency", latency.distribution
    if distribution is None:
        return Finding(topic, Grade.UNKNOWN, f"not measured: {latency.why_not}")
    worst_us = distribution.max_ns / 1000
    found = (
        f"{distribution.p50_ns / 1000:.1f} µs median, {distribution.p999_ns / 1000:.1f} µs p99.9, "
        f"{worst_us:.1f} µs worst, {latency.of}"
    )
    if worst_us <= _GOOD_US:
        return Finding(topic, Grade.GOOD, found)
    grade = Grade.WARNING if worst_us <= 1e6 / _FREQUENCY_HZ else Grade.BAD
    return Finding(topic, grade, found, f"below {_GOOD_US:g} µs", "correct the findings above")


def verdict(findings: list[Finding]) -> tuple[Grade, str]:
    """Return the worst grade and a sentence about it."""
    bad = [each.topic for each in findings if each.grade == Grade.BAD]
    warned = [each.topic for each in findings if each.grade == Grade.WARNING]
    if bad:
        return Grade.BAD, f"this machine is not real time: {', '.join(bad)}"
    if warned:
        return Grade.WARNING, f"real time with weak points: {', '.join(warned)}"
    return Grade.GOOD, "this machine is fit for real time"


def report(findings: list[Finding], latency: runner_pb2.Distribution | None, output: Output) -> int:
    """Print all findings and the verdict; return the exit code."""
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
        return _EXIT_CODES[grade]
    for each in findings:
        output.line(f"{each.grade.name.lower():<8} {each.topic}: {each.found}", _STYLES[each.grade])
        if each.wanted and each.grade != Grade.GOOD:
            output.line(f"{'':<8} should be: {each.wanted}")
        if each.remedy and each.grade != Grade.GOOD:
            output.line(f"{'':<8} remedy:    {each.remedy}")
    output.line(sentence, _STYLES[grade])
    return _EXIT_CODES[grade]

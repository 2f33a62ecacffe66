"""Settings of runners: defaults, merging, checks.

Regular expressions are checked by an executor, because it compiles them with the
engine that uses them: see executor/command.py.
"""

import math
import os
from collections.abc import Mapping
from typing import Any, TypeVar

from google.protobuf.descriptor import FieldDescriptor
from rtcf.v1 import errors_pb2, runner_pb2
from rtcf_shared import quantities
from rtcf_shared.enums import word
from rtcf_shared.quantities import Quantity

from rtcfd.common.errors import InvalidArgument

Settings = TypeVar("Settings", runner_pb2.RunnerSettings, runner_pb2.RosSettings)

_DOUBLE = FieldDescriptor.CPPTYPE_DOUBLE
# By unit, the suffix of a setting's name.
_SUFFIXES = {"Hz": "hz", "µs": "us", "ms": "ms", "s": "s", "KiB": "kb"}
LAST_CPU = -1  # of the CPUs with the fewest loops, an isolated one, else the highest number
_LEVELS_PER_OCTAVE = 2  # priorities of SCHED_FIFO: 53 at 0.1 Hz, 91 at 50 kHz
ORPHAN_TIMEOUT_S = quantities.RUNNER["orphan_timeout_s"].default
# The executors of a private rtcfd end soon after it, even if it crashes.
PRIVATE_ORPHAN_TIMEOUT_S = 2.0
_DEFAULT_MASTER = "http://localhost:11311"


def defaults(
    realtime: runner_pb2.Realtime,
    orphan_timeout_s: float = ORPHAN_TIMEOUT_S,
    peers: "runner_pb2.Right" = runner_pb2.RIGHT_OBSERVE,
) -> runner_pb2.RunnerSettings:
    """Return all settings except for the priority; ROS_MASTER_URI is from our environment."""
    result = runner_pb2.RunnerSettings(
        cpu=LAST_CPU,
        realtime=realtime,
        overrun=runner_pb2.OVERRUN_POLICY_SKIP,
        lock_memory=True,
        spin_auto=False,
        on_boot=runner_pb2.ON_BOOT_HOLD,
        on_crash=runner_pb2.ON_CRASH_HOLD,
        sim_time=runner_pb2.SIM_TIME_AUTO,
        ros=runner_pb2.RosSettings(
            enabled=True,
            master_uri=os.environ.get("ROS_MASTER_URI") or _DEFAULT_MASTER,
            whitelist="",
            blacklist="",
            hostname="",
            ns="",
            latch="",
            decimate=".*",
            stamped="",
            refuse_out_of_range=False,
            peers=peers,
        ),
    )
    tables: list[tuple[Any, Mapping[str, Quantity]]] = [
        (result, quantities.RUNNER), (result.ros, quantities.ROS),
    ]  # fmt: skip
    for message, known in tables:
        for field, quantity in known.items():
            if field == "priority":
                continue  # see completed()
            whole = message.DESCRIPTOR.fields_by_name[field].cpp_type != _DOUBLE
            setattr(message, field, int(quantity.default) if whole else quantity.default)
    result.orphan_timeout_s = orphan_timeout_s
    return result


def completed(settings: runner_pb2.RunnerSettings) -> runner_pb2.RunnerSettings:
    """Return settings with a priority, which follows from the frequency if it is not set.

    The faster of two loops on one CPU has the higher priority: no other order of fixed priorities
    meets deadlines that this one misses (rate-monotonic: C. L. Liu and J. W. Layland, "Scheduling
    Algorithms for Multiprogramming in a Hard-Real-Time Environment", Journal of the ACM 20, 1973).
    The priority depends on this loop alone, so that it stays when other loops change.
    """
    if settings.HasField("priority"):
        return settings
    known = quantities.RUNNER["priority"]
    octaves = math.log2(settings.frequency_hz / quantities.RUNNER["frequency_hz"].default)
    wanted = round(known.default + _LEVELS_PER_OCTAVE * octaves)
    result = runner_pb2.RunnerSettings()
    result.CopyFrom(settings)
    result.priority = int(min(max(wanted, known.low), known.high))
    return result


def merged(
    base: runner_pb2.RunnerSettings, change: runner_pb2.RunnerSettings
) -> runner_pb2.RunnerSettings:
    """Return `base` with the settings of `change`; UNSPECIFIED counts as unset there."""
    effective = runner_pb2.RunnerSettings()
    effective.CopyFrom(change)
    for field in ("realtime", "overrun", "on_boot", "on_crash", "sim_time"):
        if not getattr(effective, field):
            effective.ClearField(field)
    if effective.HasField("ros") and not effective.ros.peers:
        effective.ros.ClearField("peers")
    result = runner_pb2.RunnerSettings()
    result.CopyFrom(base)
    result.MergeFrom(effective)
    return result


def changed(base: Settings, other: Settings) -> Settings:
    """Return the settings that `other` sets and that differ from `base`."""
    result = type(other)()
    for field, value in other.ListFields():
        if field.message_type is not None:
            inner = changed(getattr(base, field.name), value)
            if inner.ListFields():
                getattr(result, field.name).CopyFrom(inner)
        elif not _same(getattr(base, field.name), value):
            setattr(result, field.name, value)
    return result


def differences(base: Settings, other: Settings, prefix: str = "") -> list[str]:
    """Return a line for each setting that `other` sets and that differs from `base`."""
    lines: list[str] = []
    for field, value in changed(base, other).ListFields():
        old = getattr(base, field.name)
        if field.message_type is not None:
            lines += differences(old, value, f"{field.name}.")
        else:
            lines.append(f"{prefix}{field.name} {_text(field, old)} -> {_text(field, value)}")
    return lines


def replaced(before: Settings, after: Settings) -> list[str]:
    """Return a line for each setting that both set, differently."""
    both = type(after)()
    for field, value in after.ListFields():
        if field.message_type is None and before.HasField(field.name):
            setattr(both, field.name, value)
    lines = differences(before, both)
    if isinstance(before, runner_pb2.RunnerSettings) and isinstance(after, type(before)):
        lines += [f"ros.{line}" for line in replaced(before.ros, after.ros)]
    return lines


def _same(one: Any, other: Any) -> bool:
    # An executor counts in ns, so its values may be rounded.
    if isinstance(one, float):
        return math.isclose(one, other, rel_tol=1e-9, abs_tol=1e-9)
    return bool(one == other)


def _text(field: Any, value: Any) -> str:
    if field.enum_type is not None:
        return word(field.enum_type, value)
    if isinstance(value, bool):
        return "true" if value else "false"
    return f"{value:g}" if isinstance(value, float) else str(value) or "''"


def check(settings: runner_pb2.RunnerSettings) -> None:
    """Raise InvalidArgument if a setting has a value that is not allowed."""
    _check_ranges(settings, quantities.RUNNER)
    _check_ranges(settings.ros, quantities.ROS)
    if settings.HasField("cpu") and settings.cpu != LAST_CPU:
        allowed = os.sched_getaffinity(0)
        if settings.cpu not in allowed:
            raise InvalidArgument(
                f"rtcfd may not use CPU {settings.cpu}: choose one of "
                f"{_ranges(allowed)}, or -1 for the last of them",
                errors_pb2.REASON_VALUE_INVALID,
                setting="cpu",
            )
    if settings.HasField("ros") and settings.ros.HasField("master_uri"):
        uri = settings.ros.master_uri
        if not uri.startswith(("http://", "https://")):
            raise InvalidArgument(
                f'ROS master URI "{uri}" is not valid: write it as http://HOST:PORT',
                errors_pb2.REASON_VALUE_INVALID,
                setting="master_uri",
            )


def check_stored(settings: runner_pb2.RunnerSettings) -> None:
    """Raise InvalidArgument if a number is out of range on any machine.

    For settings that were checked when they were stored: a CPU that rtcfd may not use any more does
    not make them invalid, because the runner can get another one.
    """
    _check_ranges(settings, quantities.RUNNER)
    _check_ranges(settings.ros, quantities.ROS)
    if settings.HasField("cpu") and settings.cpu < LAST_CPU:
        raise InvalidArgument(
            f"CPU {settings.cpu} does not exist: choose a number from 0, or -1 for the last CPU",
            errors_pb2.REASON_VALUE_INVALID,
            setting="cpu",
        )


def _check_ranges(message: Any, known: Mapping[str, Quantity]) -> None:
    for field, quantity in known.items():
        if message.HasField(field) and not quantity.holds(value := getattr(message, field)):
            name = field.removesuffix("_" + _SUFFIXES.get(quantity.unit, "")).replace("_", " ")
            unit = quantity.unit and f" {quantity.unit}"
            raise InvalidArgument(
                f"{name} of {value:g}{unit} is out of range: {quantity.range()}",
                errors_pb2.REASON_VALUE_INVALID,
                setting=field,
            )


def _ranges(numbers: set[int]) -> str:
    """Return CPUs as Linux writes them: "0-3,6"."""
    parts: list[list[int]] = []
    for number in sorted(numbers):
        if parts and number == parts[-1][-1] + 1:
            parts[-1].append(number)
        else:
            parts.append([number])
    return ",".join(str(p[0]) if len(p) == 1 else f"{p[0]}-{p[-1]}" for p in parts)

"""Settings of runners: their defaults, and what is allowed.

Regular expressions are left to the executor, which compiles them with the
engine that will use them.
"""

import math
import os

from rtcf.v1 import runner_pb2

from rtcfd.errors import InvalidArgument

FREQUENCY_HZ = (0.1, 20000.0)
PRIORITY = (1, 98)  # 99 is the kernel's own watchdog and migration threads'
LAST_CPU = -1  # the last one that is allowed
_MAX_MEMORY_KB = 64 * 1024 * 1024
_DEFAULT_MASTER = "http://localhost:11311"


def defaults(realtime: runner_pb2.Realtime) -> runner_pb2.RunnerSettings:
    """Return complete settings; ROS_MASTER_URI of our environment is part of them."""
    return runner_pb2.RunnerSettings(
        frequency_hz=1000.0,
        cpu=LAST_CPU,
        priority=80,
        spin_us=0,
        realtime=realtime,
        overrun=runner_pb2.OVERRUN_POLICY_SKIP,
        max_overruns=0,
        lock_memory=True,
        heap_kb=8192,
        stack_kb=256,
        ros=runner_pb2.RosSettings(
            enabled=True,
            master_uri=os.environ.get("ROS_MASTER_URI") or _DEFAULT_MASTER,
            whitelist="",
            blacklist="",
            queue=1000,
        ),
    )


def merged(
    base: runner_pb2.RunnerSettings, change: runner_pb2.RunnerSettings
) -> runner_pb2.RunnerSettings:
    """Return `base` with what `change` sets; what is UNSPECIFIED there counts as unset."""
    effective = runner_pb2.RunnerSettings()
    effective.CopyFrom(change)
    if effective.realtime == runner_pb2.REALTIME_UNSPECIFIED:
        effective.ClearField("realtime")
    if effective.overrun == runner_pb2.OVERRUN_POLICY_UNSPECIFIED:
        effective.ClearField("overrun")
    result = runner_pb2.RunnerSettings()
    result.CopyFrom(base)
    result.MergeFrom(effective)
    return result


def check(settings: runner_pb2.RunnerSettings) -> None:
    """Refuse settings that are set and not allowed."""
    if settings.HasField("frequency_hz"):
        low, high = FREQUENCY_HZ
        value = settings.frequency_hz
        if not (math.isfinite(value) and low <= value <= high):
            raise InvalidArgument(
                f"frequency of {value:g} Hz is out of range: {low:g} to {high:g} Hz"
            )
    if settings.HasField("cpu") and settings.cpu != LAST_CPU:
        allowed = os.sched_getaffinity(0)
        if settings.cpu not in allowed:
            raise InvalidArgument(
                f"CPU {settings.cpu} is not one rtcfd may use: choose of "
                f"{_ranges(allowed)}, or -1 for the last of them"
            )
    if settings.HasField("priority") and not PRIORITY[0] <= settings.priority <= PRIORITY[1]:
        raise InvalidArgument(
            f"priority {settings.priority} is out of range: {PRIORITY[0]} to {PRIORITY[1]}"
        )
    for field in ("heap_kb", "stack_kb"):
        if settings.HasField(field) and getattr(settings, field) > _MAX_MEMORY_KB:
            raise InvalidArgument(
                f"{field} of {getattr(settings, field)} is out of range: at most {_MAX_MEMORY_KB}"
            )
    if settings.HasField("ros") and settings.ros.HasField("master_uri"):
        uri = settings.ros.master_uri
        if not uri.startswith(("http://", "https://")):
            raise InvalidArgument(
                f'ROS master URI "{uri}" is not valid: write it as http://HOST:PORT'
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

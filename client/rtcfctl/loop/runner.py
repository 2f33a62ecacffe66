"""`rtcfctl runner list|add|set|restart|remove`."""

import argparse
import math
from typing import Any

import rtcf
from rtcf.v1 import runner_pb2
from rtcf_shared.enums import choices
from rtcf_shared.quantities import ROS, RUNNER

from rtcfctl.loop.status import print_runners
from rtcfctl.terminal.output import Output
from rtcfctl.terminal.words import amount

# Enum fields of RunnerSettings.
_CHOICES = {
    "realtime": choices(runner_pb2.Realtime.DESCRIPTOR),
    "overrun": choices(runner_pb2.OverrunPolicy.DESCRIPTOR),
    "on_boot": choices(runner_pb2.OnBoot.DESCRIPTOR),
    "on_crash": choices(runner_pb2.OnCrash.DESCRIPTOR),
    "sim_time": choices(runner_pb2.SimTime.DESCRIPTOR),
}
_RIGHTS = choices(runner_pb2.Right.DESCRIPTOR)
# Other fields of RunnerSettings and RosSettings; each has an option.
_FIELDS = ("frequency_hz", "cpu", "priority", "spin_us", "spin_auto", "max_overruns",
           "warmup_cycles", "stall_timeout_ms", "hook_timeout_s", "orphan_timeout_s",
           "lock_memory", "heap_kb", "stack_kb", "max_clock_jump_s", "log_limit",
           "frame_kb")  # fmt: skip
_ROS_FIELDS = ("enabled", "master_uri", "hostname", "ns", "whitelist", "blacklist", "queue",
               "latch", "decimation", "decimate", "stamped", "largest_message_kb",
               "refuse_out_of_range")  # fmt: skip


def register(verbs: Any, common: argparse.ArgumentParser) -> None:
    """Add the noun and its verbs."""
    noun = verbs.add_parser("runner", help="list, add, set, restart or remove runners")
    actions = noun.add_subparsers(metavar="ACTION", required=True)

    listing = actions.add_parser("list", parents=[common], help="list all runners")
    listing.set_defaults(run=show)

    add = actions.add_parser("add", parents=[common], help="add a runner and start its executor")
    add.add_argument("name", metavar="NAME")
    _settings_options(add)
    add.set_defaults(run=add_runner)

    change = actions.add_parser("set", parents=[common], help="change settings of a runner")
    change.add_argument("name", metavar="NAME", nargs="?", default="")
    _settings_options(change)
    change.set_defaults(run=set_runner)

    again = actions.add_parser(
        "restart",
        parents=[common],
        help="start a new executor with the same graph, without starting its loop",
    )
    again.add_argument("name", metavar="NAME")
    again.set_defaults(run=restart_runner)

    remove = actions.add_parser("remove", parents=[common], help="stop a runner and remove it")
    remove.add_argument("name", metavar="NAME")
    remove.set_defaults(run=remove_runner)


def show(client: rtcf.Client, args: argparse.Namespace, output: Output) -> None:
    """Print the runners."""
    runners = list(client.get_status(args.runner).runners)
    if output.for_people:
        print_runners(runners, output)
    else:
        output.data(runners)


def _named(args: argparse.Namespace) -> str:
    """Return the runner given by -r or NAME.  Raises ValueError if they differ."""
    if args.runner and args.name and args.runner != args.name:
        raise ValueError(f"-r {args.runner} and {args.name}: specify one runner")
    return str(args.name or args.runner)


def add_runner(client: rtcf.Client, args: argparse.Namespace, output: Output) -> None:
    """Add a runner."""
    status = client.add_runner(_named(args), settings_of(args), output.progress)
    _changed(output, f"runner {status.runner} added", status)


def set_runner(client: rtcf.Client, args: argparse.Namespace, output: Output) -> None:
    """Change settings."""
    settings = settings_of(args)
    if not settings.ListFields():
        raise ValueError("runner set: no setting given; see `rtcfctl runner set --help`")
    status = client.set_runner(settings, _named(args), output.progress)
    _changed(output, f"runner {status.runner} set", status)


def restart_runner(client: rtcf.Client, args: argparse.Namespace, output: Output) -> None:
    """Restart a runner's executor."""
    status = client.restart_runner(_named(args), output.progress)
    _changed(output, f"runner {status.runner} restarted", status)


def remove_runner(client: rtcf.Client, args: argparse.Namespace, output: Output) -> None:
    """Remove a runner."""
    client.remove_runner(_named(args), output.progress)
    if output.for_people:
        print(f"runner {args.name} removed")
    else:
        output.data({"runner": args.name})


def settings_of(args: argparse.Namespace) -> runner_pb2.RunnerSettings:
    """Return the settings given as options."""
    settings = runner_pb2.RunnerSettings()
    for field in _FIELDS:
        _take(settings, field, getattr(args, field))
    for field, known in _CHOICES.items():
        _take(settings, field, known.get(getattr(args, field)))
    ros = runner_pb2.RosSettings()
    for field in _ROS_FIELDS:
        _take(ros, field, getattr(args, f"ros_{field}"))
    _take(ros, "peers", _RIGHTS.get(args.ros_peers))
    if ros.ListFields():
        settings.ros.CopyFrom(ros)
    return settings


def _take(message: Any, field: str, value: Any) -> None:
    if value is None:
        return
    try:
        setattr(message, field, value)
    except ValueError:
        raise ValueError(f"{field} of {value} is out of range") from None


def _settings_options(to: argparse.ArgumentParser) -> None:
    switch = argparse.BooleanOptionalAction
    add_quantity(to, "--frequency", "frequency_hz", "cycles per second, e.g. 2kHz")
    to.add_argument(
        "--cpu", type=int, metavar="N", help="pin the loop to this CPU; -1: one with few loops"
    )
    add_quantity(to, "--priority", "priority", "priority of SCHED_FIFO; the default is for 1 kHz")
    add_quantity(to, "--spin", "spin_us", "wait in a busy loop before each deadline, e.g. 30us")
    to.add_argument(
        "--spin-auto", action=switch, help="choose --spin from the observed wake-up latency"
    )
    to.add_argument(
        "--realtime",
        choices=_CHOICES["realtime"],
        help="reject a start without real-time rights, or only warn",
    )
    to.add_argument("--overrun", choices=_CHOICES["overrun"], help="what to do after a late cycle")
    add_quantity(to, "--max-overruns", "max_overruns", "stop after more than N overruns; 0: never")
    add_quantity(
        to, "--warmup-cycles", "warmup_cycles", "exclude the first N cycles from the statistics"
    )
    add_quantity(
        to,
        "--stall-timeout",
        "stall_timeout_ms",
        "end the executor if a cycle makes no progress for this time, e.g. 2s; 0: never",
    )
    add_quantity(
        to,
        "--hook-timeout",
        "hook_timeout_s",
        "fail a change if a hook outside the cycle, as configure(), takes longer, e.g. 30s",
    )
    add_quantity(
        to,
        "--orphan-timeout",
        "orphan_timeout_s",
        "stop the loop if rtcfd is absent for this time",
    )
    to.add_argument(
        "--on-boot",
        choices=_CHOICES["on_boot"],
        help="what to do with the loop when rtcfd starts",
    )
    to.add_argument("--on-crash", choices=_CHOICES["on_crash"], help="what to do after a crash")
    to.add_argument(
        "--sim-time",
        choices=_CHOICES["sim_time"],
        help="follow /clock; auto: if /use_sim_time is true",
    )
    add_quantity(
        to,
        "--max-clock-jump",
        "max_clock_jump_s",
        "re-base the loop if the simulated clock jumps ahead by more than this",
    )
    add_quantity(
        to,
        "--log-limit",
        "log_limit",
        "forward at most N log records per second of a source line; 0: no limit",
    )
    to.add_argument("--lock-memory", action=switch, help="lock the executor's memory")
    add_quantity(to, "--heap-kb", "heap_kb", "heap allocated at the start")
    add_quantity(to, "--stack-kb", "stack_kb", "stack of the real-time thread")
    add_quantity(
        to,
        "--frame-kb",
        "frame_kb",
        "limit the larger values that each cycle copies; 0: only watched ones",
    )
    to.add_argument(
        "--refuse-out-of-range",
        dest="ros_refuse_out_of_range",
        action=switch,
        help="fail dynamic_reconfigure with a value out of range, or take the nearest value",
    )
    to.add_argument("--ros", dest="ros_enabled", action=switch, help="create a ROS node")
    to.add_argument("--master-uri", dest="ros_master_uri", metavar="URI", help="set the ROS master")
    to.add_argument(
        "--hostname",
        dest="ros_hostname",
        metavar="HOST",
        help="name or address under which ROS peers reach the loop's node",
    )
    to.add_argument(
        "--namespace",
        dest="ros_ns",
        metavar="NAMESPACE",
        help="namespace of cycles and the runner's services; \"\": the node's name",
    )
    to.add_argument(
        "--whitelist",
        dest="ros_whitelist",
        metavar="REGEX",
        help="make connections ROS topics if their whole mapped name matches",
    )
    to.add_argument(
        "--blacklist", dest="ros_blacklist", metavar="REGEX", help="exclude names from --whitelist"
    )
    add_quantity(to, "--queue", "ros_queue", "keep at most N messages for a slow subscriber")
    to.add_argument(
        "--latch",
        dest="ros_latch",
        metavar="REGEX",
        help="send the last message of these connections to late subscribers",
    )
    add_quantity(to, "--decimation", "ros_decimation", "publish each N-th value of outputs")
    to.add_argument(
        "--decimate",
        dest="ros_decimate",
        metavar="REGEX",
        help="apply --decimation to these connections (default: .*)",
    )
    to.add_argument(
        "--stamped",
        dest="ros_stamped",
        metavar="REGEX",
        help="publish these numbers and bools with the time of their cycle in a header",
    )
    add_quantity(
        to, "--largest-message", "ros_largest_message_kb", "drop larger messages of variable size"
    )
    to.add_argument(
        "--ros-peers",
        choices=_RIGHTS,
        help="right of all ROS peers (ROS does not identify users)",
    )


def add_quantity(to: argparse.ArgumentParser, option: str, dest: str, text: str) -> None:
    """Add an option for a numeric setting, with its unit, range and default."""
    ros = dest.startswith("ros_")
    quantity = ROS[dest.removeprefix("ros_")] if ros else RUNNER[dest]

    def value(text: str) -> float | int:
        number = amount(quantity.unit)(text)
        if isinstance(quantity.default, int):
            if not math.isfinite(number) or number != int(number):
                raise argparse.ArgumentTypeError(f"{text} is not a whole number of {quantity.unit}")
            return int(number)
        return number

    unit = {"µs": "us"}.get(quantity.unit, quantity.unit)
    to.add_argument(
        option,
        dest=dest,
        type=value,
        metavar=unit.upper() or "N",
        help=f"{text} ({quantity.range()}, default {quantity.default:g})",
    )


def _changed(output: Output, sentence: str, status: runner_pb2.RunnerStatus) -> None:
    if not output.for_people:
        output.data(status)
        return
    print(sentence)
    if status.status:
        output.line(f"{status.runner}: {status.status}", "yellow")

"""`rtcfctl incident`: files of rtcfd with the last cycles before faults."""

import argparse
import contextlib
import shutil
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path
from typing import IO, Any

import rtcf
from rtcf.v1 import incidents_pb2
from rtcf_shared.arrays import as_list
from rtcf_shared.whole_files import whole_file

from rtcfctl.terminal.output import Output
from rtcfctl.terminal.words import counted, date, microseconds

_CYCLES = 10  # shown cycles
_SIGNALS = 40  # shown signals of the faulting component, or of all components
_CHANGES = 5  # shown parameter changes
_EVENTS = 8  # shown events


def register(verbs: Any, common: argparse.ArgumentParser) -> None:
    """Add the noun and its verbs."""
    noun = verbs.add_parser("incident", help="take, list, show, export or remove incidents")
    actions = noun.add_subparsers(metavar="ACTION", required=True)

    taking = actions.add_parser(
        "take", parents=[common], help="write the last cycles to an incident now"
    )
    taking.add_argument("--reason", default="", metavar="TEXT", help="text shown with the incident")
    taking.set_defaults(run=take)

    listing = actions.add_parser("list", parents=[common], help="list the incidents")
    listing.set_defaults(run=show_all)

    showing = actions.add_parser("show", parents=[common], help="show a summary")
    _add_name(showing)
    showing.set_defaults(run=show)

    exporting = actions.add_parser("export", parents=[common], help="copy the MCAP file")
    _add_name(exporting)
    exporting.add_argument(
        "--to", metavar="FILE", type=Path, help="output file (default: INCIDENT.mcap)"
    )
    exporting.set_defaults(run=export)

    removing = actions.add_parser("rm", parents=[common], help="remove incidents")
    removing.add_argument("names", nargs="+", metavar="INCIDENT")
    removing.set_defaults(run=remove)


def _add_name(to: argparse.ArgumentParser) -> None:
    to.add_argument("name", nargs="?", default="", metavar="INCIDENT", help="default: the newest")


def take(client: rtcf.Client, args: argparse.Namespace, output: Output) -> None:
    """Take an incident."""
    kept = client.take_incident(args.runner, args.reason)
    if output.for_people:
        output.line(f"{kept.name} in {kept.file}: rtcfctl incident show {kept.name}")
    else:
        output.data(kept)


def show_all(client: rtcf.Client, args: argparse.Namespace, output: Output) -> None:
    """Print a table of incidents."""
    found = client.list_incidents(args.runner)
    if not output.for_people:
        output.data(found)
        return
    output.table(
        ("incident", "runner", "time", "MB", "seen", "reason"),
        [(each.name, each.runner, date(each.time_ns), f"{each.bytes / 1e6:.1f}",
          "yes" if each.seen else "no", each.reason)
         for each in found],
        right=("MB",),
    )  # fmt: skip


def show(client: rtcf.Client, args: argparse.Namespace, output: Output) -> None:
    """Print a summary of an incident."""
    with (
        _received(client, args.name) as (incident, file),
        rtcf.read_recording(file.name) as recording,
    ):
        summary = _summary(incident, recording)
    if output.for_people:
        _print(summary, output)
    else:
        output.data(summary)


def export(client: rtcf.Client, args: argparse.Namespace, output: Output) -> None:
    """Copy the file of an incident."""
    if args.to is not None:
        # Imported here to keep the other actions fast.
        from rtcf.recording.files import require_mcap_name

        require_mcap_name(args.to)
    with _received(client, args.name) as (incident, received):
        to = args.to or Path(f"{incident.name}.mcap")
        try:
            with whole_file(to) as part, part.open("wb") as file:
                shutil.copyfileobj(received, file)
        except FileExistsError:
            raise ValueError(f"{to} exists: choose another file with --to") from None
        except (FileNotFoundError, NotADirectoryError, PermissionError) as error:
            raise ValueError(f"{to}: {error.strerror}") from None
        except OSError as error:
            raise rtcf.RtcfError(f"{to} cannot be written: {error.strerror or error}") from None
    if output.for_people:
        output.line(f"{incident.name} in {to}")
    else:
        output.data({"incident": incident.name, "file": str(to)})


@contextlib.contextmanager
def _received(client: rtcf.Client, name: str) -> Iterator[tuple[incidents_pb2.Incident, IO[bytes]]]:
    """Yield an incident and its file, copied to a temporary file."""
    with contextlib.ExitStack() as stack:
        try:
            received = stack.enter_context(tempfile.NamedTemporaryFile(suffix=".mcap"))
            incident = client.get_incident(received, name)
            received.flush()
            received.seek(0)
        except OSError as error:
            raise rtcf.RtcfError(
                f"cannot copy the incident to {tempfile.gettempdir()}: {error.strerror or error}"
            ) from None
        yield incident, received


def remove(client: rtcf.Client, args: argparse.Namespace, output: Output) -> None:
    """Remove incidents."""
    gone = client.remove_incidents(args.names)
    if output.for_people:
        output.line(f"{counted(len(gone), 'incident')} removed")
    else:
        output.data(gone)


def _summary(incident: incidents_pb2.Incident, recording: "rtcf.Recording") -> dict[str, Any]:
    about = recording.metadata.get("incident", {})
    cycles = recording.cycles
    cycle = int(about.get("cycle", 0))
    # End at the faulting cycle; the loop may have continued after it.
    end = _end(cycles, cycle)
    last = slice(max(end - _CYCLES, 0), end)
    component = about.get("component", "")
    # Without a faulting component, show the signals of all components.
    names = [name for name in recording.signals if name.startswith(f"{component}.")]
    names = names or list(recording.signals)
    values = {}
    for name in names[:_SIGNALS]:
        column = recording.read(name)
        if at := _end(column.cycles, cycle):
            values[name] = {
                "cycle": int(column.cycles[at - 1]),
                "value": column.values[at - 1].tolist(),
            }
    return {
        "incident": incident.name,
        "runner": incident.runner,
        "time": date(incident.time_ns),
        "reason": incident.reason,
        "component": component,
        "cycle": cycle,
        "rtcf": about.get("rtcf", ""),
        "executor": about.get("executor", ""),
        "notes": [note for note in about.get("notes", "").split("\n") if note],
        "components": len(recording.listed("graph")),
        "cycles": len(cycles),
        "last_cycles": [
            {"cycle": int(cycle), "duration_us": duration / 1e3, "latency_us": latency / 1e3}
            for cycle, duration, latency in zip(
                as_list(cycles[last]),
                as_list(recording.durations_ns[last]),
                as_list(recording.latencies_ns[last]),
                strict=True,
            )
        ],
        "values": values,
        "values_left_out": max(len(names) - _SIGNALS, 0),
        "parameters": recording.listed("parameters")[-_CHANGES:],
        "events": recording.listed("events")[-_EVENTS:],
        "libraries": recording.metadata.get("libraries", {}),
    }


def _end(cycles: Any, cycle: int) -> int:
    """Return the number of cycles up to and including `cycle`, or of all if it is not there."""
    found = (cycles == cycle).nonzero()[0]
    return int(found[-1]) + 1 if len(found) else len(cycles)


def _print(summary: dict[str, Any], output: Output) -> None:
    output.line(f"{summary['incident']}: {summary['reason']}", "bold")
    what = f"runner {summary['runner']}, {summary['time']}, cycle {summary['cycle']}"
    output.line(
        f"{what}, {counted(summary['components'], 'component')}, rtcf {summary['executor']}"
    )
    for note in summary["notes"]:
        output.line(note, "yellow")
    cycles = summary["last_cycles"]
    print(f"\nup to cycle {summary['cycle']}, of {counted(summary['cycles'], 'cycle')}")
    output.table(
        ("cycle", "duration µs", "wake-up µs"),
        [(each["cycle"], microseconds(each["duration_us"] * 1e3),
          microseconds(each["latency_us"] * 1e3)) for each in cycles],
        right=("cycle", "duration µs", "wake-up µs"),
    )  # fmt: skip
    print(f"\nvalues of {summary['component'] or 'all components'}")
    output.table(
        ("signal", "cycle", "value"),
        [(name, each["cycle"], _value(each["value"])) for name, each in summary["values"].items()],
        right=("cycle",),
    )
    if summary["values_left_out"]:
        print(f"and {summary['values_left_out']} more")
    if summary["parameters"]:
        print("\nlast parameter changes")
        for each in summary["parameters"]:
            when = _time(int(each.get("timeNs", 0)))
            name = f"{each.get('component')}.{each.get('parameter')}"
            values = f"{_parameter(each.get('before'))} -> {_parameter(each.get('value'))}"
            print(f"{when}  {name} {values} by {each.get('who')}, {each.get('how')}")
    if summary["events"]:
        print("\nevents")
        for each in summary["events"]:
            print(f"{_time(int(each.get('timeNs', 0)))}  {each.get('message')}")
    if summary["libraries"]:
        print("\nlibraries")
        for line in sorted(set(summary["libraries"].values())):
            print(line)
    sys.stdout.flush()


def _parameter(value: Any) -> str:
    """Return the text of a ParameterValue in protobuf's JSON."""
    return _value(next(iter(value.values()), None)) if isinstance(value, dict) else "?"


def _value(value: Any) -> str:
    text = str(value)
    return text if len(text) <= 60 else f"{text[:60]}…"


def _time(nanoseconds: int) -> str:
    return time.strftime("%H:%M:%S", time.localtime(nanoseconds / 1e9))

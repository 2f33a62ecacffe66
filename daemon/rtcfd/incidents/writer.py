"""Writes the file of an incident, in a process of its own; see incidents.py.

Arguments: the descriptor of a copy of the frames, and the file.  Standard input: the facts, as
JSON.
"""

import json
import os
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from rtcf_shared.mcap_writer import McapWriter
from rtcf_shared.ports import PortBatch, schema_of
from rtcf_shared.recorder import Recorder

from rtcfd.common.build_id import build_id
from rtcfd.incidents import head


def main(arguments: Sequence[str]) -> int:
    """Write the file; an error is one line on standard error, and exit status 1."""
    try:
        import numpy  # noqa: F401
    except ImportError:
        print("incidents need python3-numpy: install it", file=sys.stderr)
        return 1
    try:
        facts = json.load(sys.stdin)
        _write(int(arguments[0]), Path(arguments[1]), facts)
    except (OSError, ValueError) as error:
        reason = error.strerror if isinstance(error, OSError) else str(error)
        print(reason or type(error).__name__, file=sys.stderr)
        return 1
    return 0


def _write(descriptor: int, file: Path, facts: dict[str, Any]) -> None:
    from rtcfd.incidents import frame_file

    rings = frame_file.read(descriptor)
    notes = [note for ring in rings[-1:] for note in ring.notes()]
    with file.open("xb") as out:
        writer = McapWriter(out)
        writer.metadata(
            head.NAME,
            {
                "runner": facts["runner"],
                "reason": facts["reason"],
                "component": facts["component"],
                "time_ns": str(facts["time_ns"]),
                "sequence": str(facts["sequence"]),
                "cycle": str(facts["iteration"]),
                "rtcf": facts["version"],
                "executor": facts["executor_version"],
                "notes": "\n".join(notes),
            },
        )
        for name in ("graph", "settings", "parameters", "events"):
            writer.metadata(name, {"json": json.dumps(facts[name])})
        writer.metadata("libraries", _libraries(facts["libraries"]))
        recorder = Recorder(writer, facts["runner"])
        for ring in rings:
            schema = schema_of(ring.schema())
            for message in ring.batches():
                if message.stamps_ns:
                    recorder.add(
                        PortBatch(schema, 1, message.first_cycle, 0, message.last_of_loop, message)
                    )
        recorder.flush()
        writer.close()
        out.flush()
        os.fsync(out.fileno())


def _libraries(of: dict[str, Any]) -> dict[str, str]:
    """Return path and build id of each component's library, if the file has not changed since."""
    libraries = {}
    for component, (path, *identity) in of.items():
        try:
            status = os.stat(path)
            same = [status.st_ino, status.st_mtime_ns, status.st_size] == identity
            found = build_id(Path(path)) if same else ""
            libraries[component] = f"{path} {found or ('no build id' if same else 'changed since')}"
        except (OSError, ValueError):
            libraries[component] = f"{path} gone"
    return libraries

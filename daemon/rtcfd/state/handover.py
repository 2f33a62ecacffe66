"""What one rtcfd leaves for the next beside the executors' sockets, for as long as they last.

The defaults that its runners follow and the graphs that it has applied: so the
next one tells what an administrator has changed in the settings meanwhile from
what a client has changed in a runner.
"""

import contextlib
import json
import logging
from dataclasses import dataclass, field
from pathlib import Path

from google.protobuf import json_format
from rtcf.v1 import runner_pb2
from rtcf_shared import durable

from rtcfd.common import known_values, regular_files
from rtcfd.common.nonsense import NONSENSE
from rtcfd.common.refusals import Refusal

log = logging.getLogger(__name__)

_NAME = "handover.json"


@dataclass
class Handover:
    """What was read last."""

    defaults: runner_pb2.RunnerSettings  # complete
    graphs: dict[str, str] = field(default_factory=dict)  # digests by file


def read(folder: Path) -> Handover | None:
    """Return what an earlier rtcfd left; None if there is nothing, or nothing of use."""
    file = folder / _NAME
    try:
        document = json.loads(regular_files.read_bytes(file))
        defaults = json_format.ParseDict(
            document["defaults"], runner_pb2.RunnerSettings(), ignore_unknown_fields=True
        )
        known_values.check(defaults)
        return Handover(defaults, {str(k): str(v) for k, v in document["graphs"].items()})
    except FileNotFoundError:
        return None
    except (OSError, *NONSENSE, Refusal):
        log.warning("%s is of no use: runners are taken as they are", file)
        return None


def write(folder: Path, handover: Handover) -> None:
    """Replace it; what cannot be written is reported, and missed by the next rtcfd only."""
    document = {
        "defaults": json_format.MessageToDict(handover.defaults, preserving_proto_field_name=True),
        "graphs": handover.graphs,
    }
    try:
        durable.replace(folder / _NAME, json.dumps(document).encode(), sync=False, mode=0o600)
    except OSError as error:
        log.warning("cannot write %s: %s", folder / _NAME, error.strerror)


def remove(folder: Path) -> None:
    """Forget it, when no executor is left."""
    with contextlib.suppress(OSError):
        (folder / _NAME).unlink(missing_ok=True)

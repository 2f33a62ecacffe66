"""The handover from one rtcfd to the next: a file beside the executors' sockets.

It has the defaults of the runners, and the digests of the applied graphs.  So the next
rtcfd can distinguish changes of the settings in the meantime from changes of a runner by
clients.  The file is removed when no executor is left.
"""

import contextlib
import json
import logging
from dataclasses import dataclass, field
from pathlib import Path

from google.protobuf import json_format
from rtcf.v1 import runner_pb2
from rtcf_shared import whole_files

from rtcfd.common import enumerators, regular_files, runner_settings
from rtcfd.common.errors import RequestError
from rtcfd.common.regular_files import PARSE_ERRORS

log = logging.getLogger(__name__)

_NAME = "handover.json"


@dataclass
class Handover:
    """The defaults and graphs that an rtcfd read last."""

    defaults: runner_pb2.RunnerSettings  # complete
    graphs: dict[str, str] = field(default_factory=dict)  # digests by file


def read(folder: Path) -> Handover | None:
    """Return the handover of the previous rtcfd; None if there is none, or it is not usable."""
    file = folder / _NAME
    try:
        document = json.loads(regular_files.read_bytes(file))
        defaults = json_format.ParseDict(
            document["defaults"], runner_pb2.RunnerSettings(), ignore_unknown_fields=True
        )
        enumerators.check(defaults)
        runner_settings.check_stored(defaults)
        return Handover(defaults, {str(k): str(v) for k, v in document["graphs"].items()})
    except FileNotFoundError:
        return None
    except (OSError, *PARSE_ERRORS, RequestError):
        log.warning("cannot use %s: runners stay as they are", file)
        return None


def write(folder: Path, handover: Handover) -> None:
    """Replace the file; log an error, which only affects the next rtcfd."""
    document = {
        "defaults": json_format.MessageToDict(handover.defaults, preserving_proto_field_name=True),
        "graphs": handover.graphs,
    }
    try:
        whole_files.replace(folder / _NAME, json.dumps(document).encode(), sync=False, mode=0o600)
    except OSError as error:
        log.warning("cannot write %s: %s", folder / _NAME, error.strerror)


def remove(folder: Path) -> None:
    """Remove the file, when no executor is left."""
    with contextlib.suppress(OSError):
        (folder / _NAME).unlink(missing_ok=True)

"""Desired states on disk: one JSON file per runner, replaced atomically.

A file that cannot be read is set aside and reported, never overwritten.
"""

import dataclasses
import json
import logging
import os
import time
from pathlib import Path
from typing import Any

from google.protobuf import json_format
from rtcf.v1 import graph_pb2, runner_pb2

from rtcfd.desired import Desired, HoldTerms, LeaseTerms
from rtcfd.errors import Refusal
from rtcfd.names import check_base_name, full_name

log = logging.getLogger(__name__)

VERSION = 1
_SUFFIX = ".json"


class Store:
    """The state folder; None keeps nothing."""

    def __init__(self, folder: Path | None) -> None:
        self._folder = folder

    def prepare(self) -> None:
        """Make the folder; raises OSError."""
        if self._folder is not None:
            self._folder.mkdir(mode=0o750, parents=True, exist_ok=True)

    def load(self) -> list[Desired]:
        """Return all states, by runner."""
        if self._folder is None:
            return []
        states = []
        for file in sorted(self._folder.glob(f"*{_SUFFIX}")):
            try:
                states.append(_parse(file.stem, file.read_bytes()))
            except OSError as error:
                log.error("state %s cannot be read: %s", file, error.strerror)
            except (ValueError, TypeError, KeyError, json_format.ParseError, Refusal) as error:
                self._set_aside(file, error)
        return states

    def text(self, desired: Desired) -> bytes:
        """Return what save() is to write; on the thread that owns the state."""
        # A hold is for now, what it parked is for good.
        chosen = _json(desired.hold.parked if desired.hold else desired.chosen)
        components = ",\n".join("    " + text for text in desired.component_texts())
        return (
            "{\n"
            f'  "version": {VERSION},\n'
            f'  "runner": {json.dumps(desired.runner)},\n'
            f'  "settings": {chosen},\n'
            f'  "running": {json.dumps(desired.running)},\n'
            f'  "quarantined": {json.dumps(_staying(desired, desired.quarantined))},\n'
            f'  "left_out": {json.dumps(_staying(desired, desired.left_out))},\n'
            f'  "leased": {json.dumps(_leased(desired))},\n'
            f'  "hold": {_hold(desired)},\n'
            f'  "components": [\n{components}\n  ]\n'
            "}\n"
        ).encode()

    def save(self, runner: str, text: bytes) -> None:
        """Replace a runner's file, durably; raises OSError.  May run on any thread."""
        if self._folder is None:
            return
        file = self._folder / f"{runner}{_SUFFIX}"
        temporary = self._folder / f".{runner}{_SUFFIX}.new"
        try:
            with temporary.open("wb") as out:
                out.write(text)
                out.flush()
                os.fsync(out.fileno())
            temporary.replace(file)
        except OSError:
            temporary.unlink(missing_ok=True)
            raise
        self._sync_folder(self._folder)

    def remove(self, runner: str) -> None:
        """Forget a runner; raises OSError."""
        if self._folder is None:
            return
        (self._folder / f"{runner}{_SUFFIX}").unlink(missing_ok=True)
        self._sync_folder(self._folder)

    @staticmethod
    def _sync_folder(folder: Path) -> None:
        # Without this a rename may be undone by a power cut (fsync(2), NOTES).
        descriptor = os.open(folder, os.O_RDONLY | os.O_DIRECTORY)
        try:
            os.fsync(descriptor)
        finally:
            os.close(descriptor)

    @staticmethod
    def _set_aside(file: Path, error: Exception) -> None:
        aside = file.with_name(f"{file.stem}.corrupt-{time.strftime('%Y%m%dT%H%M%S')}")
        reason = " ".join(str(error).split())
        try:
            file.rename(aside)
        except OSError as failure:
            log.error("state %s is corrupt (%s), and stays: %s", file, reason, failure.strerror)
            return
        log.error("state %s is corrupt (%s): set aside as %s", file, reason, aside)


def _json(message: Any) -> str:
    return str(json_format.MessageToJson(message, preserving_proto_field_name=True, indent=None))


def _staying(desired: Desired, reasons: dict[str, str]) -> dict[str, str]:
    return {name: reason for name, reason in reasons.items() if name not in desired.leased}


def _leased(desired: Desired) -> dict[str, dict[str, Any]]:
    return {name: dataclasses.asdict(terms) for name, terms in desired.leased.items()}


def _hold(desired: Desired) -> str:
    hold = desired.hold
    if hold is None:
        return "null"
    fields = {"token": hold.token, "holder": hold.holder, "added": hold.added}
    return f'{json.dumps(fields)[:-1]}, "settings": {_json(desired.chosen)}}}'


def _parse(runner: str, text: bytes) -> Desired:
    document = json.loads(text)
    if not isinstance(document, dict):
        raise ValueError("it is not a JSON object")
    version = document.get("version")
    if type(version) is int and version > VERSION:
        raise ValueError(f"its version is {version}, of a newer rtcfd; this one knows {VERSION}")
    if version != VERSION:
        raise ValueError(f"its version is {version!r}, not {VERSION}")
    if document.get("runner") != runner:
        raise ValueError(f"it is the state of {document.get('runner')!r}")
    desired = Desired(check_base_name("runner", runner))
    json_format.ParseDict(document.get("settings", {}), desired.chosen)
    for entry in document.get("components", []):
        spec = json_format.ParseDict(entry, graph_pb2.ComponentSpec())
        desired.put(full_name(spec), spec)
    desired.running = document.get("running", False) is True
    for name, terms in document.get("leased", {}).items():
        desired.leased[name] = LeaseTerms(**terms)
    if hold := document.get("hold"):
        desired.hold = HoldTerms(hold["token"], hold["holder"], desired.chosen, hold["added"])
        desired.chosen = json_format.ParseDict(hold["settings"], runner_pb2.RunnerSettings())
    for name, reason in document.get("quarantined", {}).items():
        desired.quarantine(name, str(reason))
    for name, reason in document.get("left_out", {}).items():
        if name in desired.components:
            desired.left_out[name] = str(reason)
    return desired

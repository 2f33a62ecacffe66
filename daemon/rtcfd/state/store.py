"""Desired states on disk: one JSON file per runner, replaced atomically.

A file that cannot be read, or is of a newer rtcfd, is set aside and reported,
never overwritten.  One of an older rtcfd is upgraded, and kept beside: a way back.
"""

import dataclasses
import json
import logging
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from google.protobuf import json_format
from rtcf.v1 import graph_pb2, runner_pb2
from rtcf_shared import durable

from rtcfd.common.names import check_base_name, full_name
from rtcfd.common.refusals import Refusal
from rtcfd.state import history
from rtcfd.state.desired import Desired, HoldTerms, LeaseTerms, this_boot
from rtcfd.state.history import Change

log = logging.getLogger(__name__)

VERSION = 2
_SUFFIX = ".json"
_MARK = ".running"
_HISTORY = ".history"

_Document = dict[str, Any]


def _from_1(document: _Document) -> None:
    """Before components could be left out, quarantined and held, and loops resumed."""
    document.setdefault("running", False)
    for key in ("quarantined", "left_out", "leased"):
        document.setdefault(key, {})
    document.setdefault("hold", None)


# What makes a document of the version after out of one of each version.
_UPGRADES: dict[int, Callable[[_Document], None]] = {1: _from_1}
assert set(_UPGRADES) == set(range(1, VERSION))


class _Newer(ValueError):
    """The state is of a newer rtcfd."""


class Store:
    """The state folder; None keeps nothing."""

    def __init__(self, folder: Path | None) -> None:
        self._folder = folder
        self.problems: list[str] = []  # that load() met, a line each

    def prepare(self) -> None:
        """Make the folder; raises OSError."""
        if self._folder is not None:
            self._folder.mkdir(mode=0o750, parents=True, exist_ok=True)

    def mark(self, runner: str) -> Path | None:
        """Return the file without which a loop is not resumed, whatever the state says.

        It is there while a loop is to run.  Removing it works on a full disk,
        and the executor does so when somebody stops its loop without rtcfd.
        """
        return None if self._folder is None else self._folder / f"{runner}{_MARK}"

    def load(self) -> list[Desired]:
        """Return all states, by runner."""
        if self._folder is None:
            return []
        states = []
        for file in sorted(self._folder.glob(f"*{_SUFFIX}")):
            try:
                text = file.read_bytes()
                document, version = _upgraded(text)
                desired = _parse(file.stem, document)
                mark = self.mark(desired.runner)
                if desired.running and mark is not None and not mark.exists():
                    # Stopped, and there was nobody or no room to write it down.
                    desired.running, desired.ended_boot = False, this_boot()
                self._read_history(desired)
                states.append(desired)
                if version != VERSION:
                    self._keep_beside(file, text, version)
            except OSError as error:
                self._report(f"state {file} cannot be read: {error.strerror}")
            except _Newer as newer:
                self._set_aside(file, "newer", str(newer))
            except (
                ValueError,
                TypeError,
                KeyError,
                AttributeError,
                RecursionError,
                json_format.ParseError,
                Refusal,
            ) as error:
                reason = " ".join(str(error).split())
                self._set_aside(file, "corrupt", f"it is corrupt ({reason})")
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
            f'  "ended_boot": {json.dumps(desired.ended_boot)},\n'
            f'  "quarantined": {json.dumps(_staying(desired, desired.quarantined))},\n'
            f'  "left_out": {json.dumps(_staying(desired, desired.left_out))},\n'
            f'  "leased": {json.dumps(_leased(desired))},\n'
            f'  "hold": {_hold(desired)},\n'
            f'  "components": [\n{components}\n  ]\n'
            "}\n"
        ).encode()

    def save(self, runner: str, text: bytes, running: bool) -> None:
        """Replace a runner's file, durably; raises OSError.  May run on any thread.

        `running`: what the text says of the loop.  That it is not to run is
        saved whatever becomes of the rest.
        """
        mark = self.mark(runner)
        if self._folder is None or mark is None:
            return
        if not running:
            mark.unlink(missing_ok=True)
            # At once: the rest may find no room, and the state before says that it runs.
            durable.sync_folder(self._folder)
        durable.replace(self._folder / f"{runner}{_SUFFIX}", text)
        if running:
            mark.touch(mode=0o640)
        durable.sync_folder(self._folder)

    def save_history(self, runner: str, changes: Sequence[Change], anew: bool) -> None:
        """Write what History.to_write() gave; raises OSError.  May run on any thread.

        It is for people, who can do without the last line after a power cut: no fsync.
        """
        if self._folder is None or not changes:
            return
        file = self._folder / f"{runner}{_HISTORY}"
        if anew:
            temporary = self._folder / f".{runner}{_HISTORY}.new"
            temporary.write_text(history.text(changes), encoding="utf-8")
            temporary.replace(file)
            return
        with file.open("a", encoding="utf-8") as out:
            out.write(history.text(changes))

    def _read_history(self, desired: Desired) -> None:
        assert self._folder is not None
        file = self._folder / f"{desired.runner}{_HISTORY}"
        try:
            desired.history.read(file.read_text(encoding="utf-8", errors="replace"))
        except FileNotFoundError:
            pass
        except OSError as error:
            self._report(f"{file} cannot be read: {error.strerror}")

    def remove(self, runner: str) -> None:
        """Forget a runner; raises OSError."""
        if self._folder is None:
            return
        (self._folder / f"{runner}{_SUFFIX}").unlink(missing_ok=True)
        (self._folder / f"{runner}{_MARK}").unlink(missing_ok=True)
        (self._folder / f"{runner}{_HISTORY}").unlink(missing_ok=True)
        durable.sync_folder(self._folder)

    def _set_aside(self, file: Path, why: str, reason: str) -> None:
        aside = file.with_name(f"{file.stem}.{why}-{time.strftime('%Y%m%dT%H%M%S')}")
        try:
            file.rename(aside)
        except OSError as failure:
            self._report(f"state {file} is not used, and stays: {reason}; {failure.strerror}")
            return
        self._report(f"state {file} is set aside as {aside.name}: {reason}")

    def _keep_beside(self, file: Path, text: bytes, version: int) -> None:
        beside = file.with_name(f"{file.stem}.version-{version}")
        try:
            beside.write_bytes(text)
        except OSError as failure:
            log.warning("state %s of version %d is not kept: %s", file, version, failure.strerror)
            return
        log.info("state %s is of version %d: upgraded, kept as %s", file, version, beside.name)

    def _report(self, problem: str) -> None:
        log.error("%s", problem)
        self.problems.append(problem)


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


def _upgraded(text: bytes) -> tuple[_Document, int]:
    """Return a document of our version, and the version it had."""
    document = json.loads(text)
    if not isinstance(document, dict):
        raise ValueError("it is not a JSON object")
    version = document.get("version")
    if type(version) is not int or version < 1:
        raise ValueError(f"its version is {version!r}, which there never was")
    if version > VERSION:
        raise _Newer(
            f"it is of version {version}, of a newer rtcfd than this, which knows {VERSION}; "
            "install that, stop rtcfd and rename the file back to have it again"
        )
    for step in range(version, VERSION):
        _UPGRADES[step](document)
    return document, version


def _parse(runner: str, document: _Document) -> Desired:
    if document.get("runner") != runner:
        raise ValueError(f"it is the state of {document.get('runner')!r}")
    desired = Desired(check_base_name("runner", runner))
    json_format.ParseDict(document["settings"], desired.chosen)
    for entry in document["components"]:
        spec = json_format.ParseDict(entry, graph_pb2.ComponentSpec())
        desired.put(full_name(spec), spec)
    desired.running = document["running"] is True
    desired.ended_boot = str(document.get("ended_boot", ""))
    for name, terms in document["leased"].items():
        desired.leased[name] = LeaseTerms(**terms)
    if hold := document["hold"]:
        desired.hold = HoldTerms(hold["token"], hold["holder"], desired.chosen, hold["added"])
        desired.chosen = json_format.ParseDict(hold["settings"], runner_pb2.RunnerSettings())
    for name, reason in document["quarantined"].items():
        desired.quarantine(name, str(reason))
    for name, reason in document["left_out"].items():
        if name in desired.components:
            desired.left_out[name] = str(reason)
    return desired

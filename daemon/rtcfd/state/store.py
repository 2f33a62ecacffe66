"""Desired states on disk: one JSON file per runner, replaced atomically.

A file that cannot be read, or is of a newer rtcfd, is set aside and reported; if that
fails, it is not overwritten.  A file of an older rtcfd is upgraded, and a copy is kept
for a downgrade.
"""

import contextlib
import dataclasses
import errno
import itertools
import json
import logging
import os
import stat
import time
from collections.abc import Callable, Collection, Sequence
from pathlib import Path
from typing import Any

from google.protobuf import json_format
from rtcf.v1 import control_pb2, errors_pb2, graph_pb2, runner_pb2
from rtcf_shared import whole_files

from rtcfd.common import enumerators, locks, regular_files, runner_settings
from rtcfd.common.errors import FailedPrecondition, RequestError
from rtcfd.common.names import check_base_name, full_name
from rtcfd.common.regular_files import PARSE_ERRORS
from rtcfd.state import history
from rtcfd.state.desired import ComponentLeaseTerms, Desired, RunnerLeaseTerms, this_boot
from rtcfd.state.history import ParameterChange

log = logging.getLogger(__name__)

VERSION = 2
_SUFFIX = ".json"
_MARK = ".running"
_HISTORY = ".history"
_STOPPED = ".stopped"
_UNREADABLE = (
    "it cannot be read ({}); to restore it, repair that, stop rtcfd and rename the file back"
)

_Document = dict[str, Any]


def _from_1(document: _Document) -> None:
    """Upgrade from version 1, without loop state, quarantine, left-out components and leases."""
    document.setdefault("running", False)
    for key in ("quarantined", "left_out", "leased"):
        document.setdefault(key, {})
    document.setdefault("hold", None)


# By version, the function that upgrades a document to the next version.
_UPGRADES: dict[int, Callable[[_Document], None]] = {1: _from_1}
assert set(_UPGRADES) == set(range(1, VERSION))


class _Newer(ValueError):
    """The state is of a newer rtcfd."""


class Store:
    """The state folder; None = no state is kept.

    `boot_folder` is for notes of stops that could not be written to the state folder.  It lasts
    until the machine's next boot.
    """

    def __init__(self, folder: Path | None, boot_folder: Path | None = None) -> None:
        self._folder = folder
        self._boot_folder = boot_folder
        self._kept: set[Path] = set()  # files that could neither be read nor set aside
        self._unseen = False  # the folder could not be read
        self.problems: list[str] = []  # the errors of load(), a line each

    def prepare(self) -> None:
        """Create the folder; raises OSError."""
        if self._folder is not None:
            self._folder.mkdir(mode=0o750, parents=True, exist_ok=True)

    def lock(self) -> None:
        """Lock the folder; raises FailedPrecondition if another rtcfd uses it."""
        if self._folder is not None:
            _lock(self._folder)

    def mark(self, runner: str) -> Path | None:
        """Return the path of a runner's mark.  Without this file its loop is not resumed, even
        if the state says so.

        The file exists while the loop is wanted.  It can be removed even on a full disk, and the
        executor removes it on a direct stop, without rtcfd.
        """
        return None if self._folder is None else self._folder / f"{runner}{_MARK}"

    def load(self, alive: Collection[str] = ()) -> list[Desired]:
        """Return all states, by runner.

        `alive` are the runners with an executor, which itself reports whether its loop runs.
        """
        if self._folder is None:
            return []
        states = []
        for file in self._files():
            try:
                text = regular_files.read_bytes(file)
                document, version = _upgraded(text)
                desired = _parse(file.stem, document)
            except OSError as error:
                self._set_aside(file, "unreadable", _UNREADABLE.format(error.strerror))
            except _Newer as newer:
                self._set_aside(file, "newer", str(newer))
            except (*PARSE_ERRORS, RequestError) as error:
                reason = " ".join(str(error).split())
                self._set_aside(file, "corrupt", f"it is corrupt ({reason})")
            else:
                if desired.running and (
                    not self._marked(desired.runner) or self._stop_is_noted(desired.runner)
                ):
                    # It was stopped, but the state could not be written then.
                    desired.running, desired.ended_boot = False, this_boot()
                if (
                    desired.running
                    and desired.runner not in alive
                    and not os.access(self._folder, os.W_OK)
                ):
                    desired.running = False
                    self._report(
                        f"the loop of {desired.runner} is not resumed: state folder "
                        f"{self._folder} cannot be written, so that a stop could not be recorded; "
                        "repair that"
                    )
                self._read_history(desired)
                states.append(desired)
                if version != VERSION:
                    self._keep_beside(file, text, version)
        return states

    def _files(self) -> list[Path]:
        assert self._folder is not None
        try:
            return sorted(each for each in self._folder.iterdir() if each.suffix == _SUFFIX)
        except OSError as error:
            self._unseen = not isinstance(error, FileNotFoundError)
            if self._unseen:
                self._report(
                    f"state folder {self._folder} cannot be read, and its files are not "
                    f"overwritten: {error.strerror}; repair that and restart rtcfd"
                )
            return []

    def _marked(self, runner: str) -> bool:
        mark = self.mark(runner)
        if mark is None:
            return False
        if os.path.lexists(mark) and not _is_mark(mark):
            self._set_aside(mark, "unreadable", "it is not a regular file, its loop is not resumed")
        return _is_mark(mark)

    def text(self, desired: Desired) -> bytes:
        """Return the text for save(); on the thread that owns the state."""
        # The settings of a lease are temporary; the parked ones are permanent.
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

        `running` is the loop's state in the text.  If it is False, this is recorded even if the
        rest fails.
        """
        mark = self.mark(runner)
        if self._folder is None or mark is None:
            return
        if not running:
            try:
                _unmark(mark)
                # Sync now: the rest may fail, and the old state says that the loop runs.
                whole_files.sync_folder(self._folder)
            except OSError:
                self.note_stop(runner)
                raise
        file = self._folder / f"{runner}{_SUFFIX}"
        self._require_known(file)
        whole_files.replace(file, text)
        if running and not _is_mark(mark):
            # This replaces anything else of that name.
            whole_files.replace(mark, b"", sync=False)
        whole_files.sync_folder(self._folder)

    def save_history(self, runner: str, changes: Sequence[ParameterChange], anew: bool) -> None:
        """Write the result of History.to_write(); raises OSError.  May run on any thread.

        Without fsync: the history is informative, and may lose its last lines in a power cut.
        """
        if self._folder is None or not changes:
            return
        file = self._folder / f"{runner}{_HISTORY}"
        self._require_known(file)
        data = history.text(changes).encode()
        if anew:
            whole_files.replace(file, data, sync=False)
        else:
            regular_files.append(file, data)

    def _read_history(self, desired: Desired) -> None:
        assert self._folder is not None
        file = self._folder / f"{desired.runner}{_HISTORY}"
        try:
            desired.history.read(regular_files.read_text(file, errors="replace"))
        except FileNotFoundError:
            pass
        except OSError as error:
            self._set_aside(file, "unreadable", _UNREADABLE.format(error.strerror))

    def remove(self, runner: str) -> None:
        """Remove all files of a runner; raises OSError."""
        if self._folder is None:
            return
        _unmark(self._folder / f"{runner}{_MARK}")
        self.forget_stop(runner)
        for suffix in (_SUFFIX, _HISTORY):
            file = self._folder / f"{runner}{suffix}"
            self._require_known(file)
            file.unlink(missing_ok=True)
        whole_files.sync_folder(self._folder)

    def _note(self, runner: str) -> Path | None:
        return None if self._boot_folder is None else self._boot_folder / f"{runner}{_STOPPED}"

    def note_stop(self, runner: str) -> None:
        """Note in the boot folder, if there is one, that a loop must not run.

        The note is valid until save() has written the state.  May run on any thread.
        """
        note = self._note(runner)
        if note is not None:
            with contextlib.suppress(OSError):
                whole_files.replace(note, b"", sync=False)

    def _stop_is_noted(self, runner: str) -> bool:
        note = self._note(runner)
        return note is not None and os.path.lexists(note)

    def forget_stop(self, runner: str) -> None:
        """Remove the note of a stop, once the state folder has a later state."""
        note = self._note(runner)
        if note is not None:
            with contextlib.suppress(OSError):
                note.unlink(missing_ok=True)

    def _set_aside(self, file: Path, why: str, reason: str) -> None:
        name = file.stem if file.suffix == _SUFFIX else file.name
        first = file.with_name(f"{name}.{why}-{time.strftime('%Y%m%dT%H%M%S')}")
        more = (first.with_name(f"{first.name}.{number}") for number in itertools.count(2))
        aside = next(each for each in itertools.chain([first], more) if not os.path.lexists(each))
        try:
            file.rename(aside)
        except OSError as failure:
            self._kept.add(file)
            self._report(f"state {file} is not used, and stays: {reason}; {failure.strerror}")
            return
        self._report(f"state {file} is set aside as {aside.name}: {reason}")

    def _keep_beside(self, file: Path, text: bytes, version: int) -> None:
        beside = file.with_name(f"{file.stem}.version-{version}")
        try:
            whole_files.replace(beside, text)
        except OSError as failure:
            log.warning("state %s of version %d is not kept: %s", file, version, failure.strerror)
            return
        log.info("state %s is of version %d: upgraded, kept as %s", file, version, beside.name)

    def _require_known(self, file: Path) -> None:
        """Raise OSError for a file that could not be read: its content would be lost."""
        if (file in self._kept or self._unseen) and os.path.lexists(file):
            raise OSError(
                errno.EPERM,
                f"{file} could not be read, and is not overwritten: repair or move it, and restart "
                "rtcfd",
            )

    def _report(self, problem: str) -> None:
        log.error("%s", problem)
        self.problems.append(problem)


def _lock(folder: Path) -> None:
    """Lock a folder until this process ends; raises FailedPrecondition if another rtcfd has it.

    Two rtcfds would overwrite each other's states.  Locks the folder itself, which works on a full
    or read-only disk.  If the file system has no locks, only logs a warning.  Blocks.
    """
    try:
        descriptor = os.open(folder, os.O_RDONLY | os.O_DIRECTORY | os.O_CLOEXEC)
    except OSError:
        return  # the reader of the folder reports it
    try:
        locked = locks.try_lock(descriptor)
    except OSError as error:
        os.close(descriptor)
        log.warning(
            "state folder %s cannot be locked (%s): start no other rtcfd with it",
            folder,
            error.strerror,
        )
        return
    if not locked:
        user = locks.holder(descriptor)
        os.close(descriptor)
        raise FailedPrecondition(
            f"state folder {folder} is in use by another rtcfd{user}: end that, or choose another "
            "--state-dir",
            errors_pb2.REASON_DAEMON_FAILED,
        )


def _is_mark(mark: Path) -> bool:
    try:
        return stat.S_ISREG(mark.lstat().st_mode)
    except OSError:
        return False


def _unmark(mark: Path) -> None:
    try:
        mark.unlink(missing_ok=True)
    except OSError:
        if _is_mark(mark):
            raise


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
    """Return a document of our version, and its original version."""
    document = json.loads(text)
    if not isinstance(document, dict):
        raise ValueError("it is not a JSON object")
    version = document.get("version")
    if type(version) is not int or version < 1:
        raise ValueError(f"its version is {version!r}, which does not exist")
    if version > VERSION:
        raise _Newer(
            f"it is of version {version}, of a newer rtcfd than this, which knows {VERSION}; to "
            "restore it, install that rtcfd, stop it and rename the file back"
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
        desired.leased[name] = ComponentLeaseTerms(**terms)
        enumerators.check_value(
            control_pb2.OnLeaseLost.DESCRIPTOR, "on_lost", desired.leased[name].on_lost
        )
    if hold := document["hold"]:
        desired.hold = RunnerLeaseTerms(
            hold["token"], hold["holder"], desired.chosen, hold["added"]
        )
        desired.chosen = json_format.ParseDict(hold["settings"], runner_pb2.RunnerSettings())
    for settings in (desired.chosen, *([desired.hold.parked] if desired.hold else [])):
        enumerators.check(settings)
        runner_settings.check_stored(settings)
    for name, reason in document["quarantined"].items():
        desired.quarantine(name, str(reason))
    for name, reason in document["left_out"].items():
        if name in desired.components:
            desired.left_out[name] = str(reason)
    return desired

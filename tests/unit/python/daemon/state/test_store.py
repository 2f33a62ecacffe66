"""State on disk after a power cut or on a full disk."""

import errno
import json
import os
import stat
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import odd_files
import pytest
from google.protobuf import json_format
from google.protobuf.descriptor import FieldDescriptor
from rtcf.v1 import graph_pb2, runner_pb2
from rtcf_shared import quantities
from rtcfd.common import runner_settings
from rtcfd.state import handover
from rtcfd.state.desired import Desired, this_boot
from rtcfd.state.handover import Handover
from rtcfd.state.store import Store

Value = graph_pb2.ParameterValue


def test_a_stop_survives_a_power_cut_even_on_a_full_disk(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    store = Store(tmp_path)
    desired = Desired("arm")
    desired.running = True
    store.save("arm", store.text(desired), running=True)
    mark = tmp_path / "arm.running"
    assert mark.exists()
    on_disk: list[bool] = []  # whether the mark exists at each fsync of the folder

    def full(descriptor: int) -> None:
        if not stat.S_ISDIR(os.fstat(descriptor).st_mode):
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        on_disk.append(mark.exists())

    monkeypatch.setattr(os, "fsync", full)
    desired.running = False
    with pytest.raises(OSError, match="No space left"):
        store.save("arm", store.text(desired), running=False)
    assert on_disk == [False]
    (state,) = store.load()
    assert not state.running
    assert sorted(file.name for file in tmp_path.iterdir()) == ["arm.json"]


def test_a_stop_on_a_read_only_disk_survives_rtcfd(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder, this_boots = tmp_path / "state", tmp_path / "run"
    folder.mkdir()
    this_boots.mkdir()
    store = Store(folder, this_boots)
    desired = Desired("arm")
    desired.running = True
    store.save("arm", store.text(desired), running=True)

    def read_only(*_: object, **__: object) -> None:
        raise OSError(errno.EROFS, os.strerror(errno.EROFS))

    desired.running = False
    with monkeypatch.context() as patch:
        patch.setattr(Path, "unlink", read_only)
        with pytest.raises(OSError, match="Read-only"):
            store.save("arm", store.text(desired), running=False)
    # The disk is writable again, but still says that the loop runs.
    (state,) = Store(folder, this_boots).load()
    assert not state.running
    assert state.ended_boot == this_boot()
    desired.running = True
    store.save("arm", store.text(desired), running=True)
    store.forget_stop("arm")  # as a save does if no stop followed
    (state,) = Store(folder, this_boots).load()
    assert state.running


def test_nothing_is_resumed_from_a_disk_that_stores_no_stop(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    desired = Desired("arm")
    desired.running = True
    store = Store(tmp_path)
    store.save("arm", store.text(desired), running=True)
    monkeypatch.setattr(os, "access", lambda path, mode: False)
    store = Store(tmp_path)
    (state,) = store.load()
    assert not state.running
    assert "the loop of arm is not resumed: state folder" in store.problems[0]
    # For a running rtcfd no guess is needed.
    store = Store(tmp_path)
    (state,) = store.load(["arm"])
    assert state.running
    assert store.problems == []


def saved(folder: Path, runner: str, running: bool = False) -> str:
    """Save the state of a runner like an earlier rtcfd; return the content on disk."""
    desired = Desired(runner)
    desired.running = running
    desired.history.note("/a", [("kp", None, Value(int_value=1))], "somebody", "set")
    store = Store(folder)
    store.save(runner, store.text(desired), running)
    store.save_history(runner, *desired.history.to_write())
    return (folder / f"{runner}.json").read_text()


def aside(folder: Path, name: str) -> list[Path]:
    return [each for each in folder.iterdir() if each.name.startswith(f"{name}.unreadable-")]


@pytest.mark.parametrize("odd", odd_files.ODD)
def test_anything_in_place_of_a_state_is_set_aside_and_others_are_read(
    tmp_path: Path, odd: Callable[[Path], None]
) -> None:
    saved(tmp_path, "leg")
    odd(tmp_path / "arm.json")
    there = (tmp_path / "arm.json").lstat()
    store = Store(tmp_path)
    with odd_files.deadline():
        assert [state.runner for state in store.load()] == ["leg"]
    (problem,) = store.problems
    assert f"{tmp_path}/arm.json is set aside as arm.unreadable-" in problem
    assert "it cannot be read (" in problem and "\n" not in problem
    # A later save replaces none of these.
    saved(tmp_path, "arm")
    (kept,) = aside(tmp_path, "arm")
    assert os.path.samestat(kept.lstat(), there)


@pytest.mark.parametrize("odd", odd_files.ODD)
def test_anything_in_place_of_a_history_is_set_aside(
    tmp_path: Path, odd: Callable[[Path], None]
) -> None:
    saved(tmp_path, "arm")
    (tmp_path / "arm.history").unlink()
    odd(tmp_path / "arm.history")
    store = Store(tmp_path)
    with odd_files.deadline():
        (state,) = store.load()
        assert aside(tmp_path, "arm.history")
        assert "arm.history is set aside as" in store.problems[0]
        state.history.note("/a", [("kp", None, Value(int_value=2))], "somebody", "set")
        store.save_history("arm", *state.history.to_write())
    (again,) = Store(tmp_path).load()
    assert [each.value.int_value for each in again.history.of()] == [2]


def test_two_files_set_aside_within_a_second_are_both_kept(tmp_path: Path) -> None:
    for _ in range(3):
        (tmp_path / "arm.json").write_text("{")
        Store(tmp_path).load()
    assert len(list(tmp_path.glob("arm.corrupt-*"))) == 3


def test_a_state_that_can_neither_be_read_nor_set_aside_is_not_overwritten(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    saved(tmp_path, "arm", running=True)
    state, mark = tmp_path / "arm.json", tmp_path / "arm.running"
    state.unlink()
    odd_files.unreadable(state)

    def read_only(*_: object) -> None:
        raise OSError(errno.EROFS, os.strerror(errno.EROFS))

    store = Store(tmp_path)
    with monkeypatch.context() as patch:
        patch.setattr(Path, "rename", read_only)
        assert store.load() == []
    assert "is not used, and stays: it cannot be read (" in store.problems[0]
    with pytest.raises(OSError, match="could not be read, and is not overwritten"):
        store.save("arm", b"{}", running=False)
    # Stopped loops stay stopped.
    assert not mark.exists()
    with pytest.raises(OSError, match="could not be read"):
        store.remove("arm")
    assert os.readlink(state) == "/proc/self/mem"
    # Once it is removed.
    state.unlink()
    store.save("arm", b"{}", running=False)
    assert state.read_bytes() == b"{}"


def test_nothing_is_overwritten_in_an_unreadable_folder(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    before = saved(tmp_path, "arm")

    def refuse(*_: object) -> None:
        raise PermissionError(errno.EACCES, os.strerror(errno.EACCES))

    store = Store(tmp_path)
    with monkeypatch.context() as patch:
        patch.setattr(os, "listdir", refuse)
        patch.setattr(os, "scandir", refuse)
        assert store.load() == []
    assert "Permission denied" in store.problems[0]
    with pytest.raises(OSError, match="could not be read"):
        store.save("arm", b"{}", running=False)
    assert (tmp_path / "arm.json").read_text() == before


@pytest.mark.parametrize("odd", [odd_files.pipe, odd_files.dangling, odd_files.plug])
def test_an_obstacle_at_a_states_path_does_not_block_a_save(
    tmp_path: Path, odd: Callable[[Path], None]
) -> None:
    for name in (".arm.json.new", ".arm.history.new", "arm.json", "arm.running"):
        odd(tmp_path / name)
    with odd_files.deadline():
        text = saved(tmp_path, "arm", running=True)
    assert (tmp_path / "arm.json").read_text() == text
    assert (tmp_path / "arm.running").is_file()
    assert not (tmp_path / "nowhere").exists()
    (state,) = Store(tmp_path).load()
    assert state.running


def test_a_pipe_in_place_of_a_history_blocks_nothing(tmp_path: Path) -> None:
    saved(tmp_path, "arm")
    store = Store(tmp_path)
    (state,) = store.load()
    file = tmp_path / "arm.history"
    file.unlink()
    odd_files.pipe(file)
    state.history.note("/a", [("kp", None, Value(int_value=2))], "somebody", "set")
    with odd_files.deadline(), pytest.raises(OSError, match="it is a named pipe"):
        store.save_history("arm", *state.history.to_write())
    # The next write contains the whole history.
    state.history.not_written()
    state.history.note("/a", [("kp", None, Value(int_value=3))], "somebody", "set")
    store.save_history("arm", *state.history.to_write())
    (again,) = Store(tmp_path).load()
    assert [each.value.int_value for each in again.history.of()] == [1, 2, 3]


@pytest.mark.parametrize("odd", [odd_files.pipe, odd_files.folder, odd_files.dangling])
def test_only_a_regular_file_is_a_mark(tmp_path: Path, odd: Callable[[Path], None]) -> None:
    saved(tmp_path, "arm", running=True)
    mark = tmp_path / "arm.running"
    mark.unlink()
    odd(mark)
    store = Store(tmp_path)
    (state,) = store.load()
    assert not state.running
    assert "its loop is not resumed" in store.problems[0]
    # Nor does a later one prevent saving a stop.
    odd(mark)
    store.save("arm", store.text(state), running=False)
    assert not mark.is_file()


def test_a_folder_in_place_of_a_file_is_reported_in_one_line(tmp_path: Path) -> None:
    (tmp_path / ".arm.json.new").mkdir()
    with pytest.raises(OSError) as failed:
        Store(tmp_path).save("arm", b"{}", running=False)
    assert failed.value.strerror == f"{tmp_path}/.arm.json.new is a folder"


@pytest.mark.parametrize(
    "text",
    [
        '{"version": 2, "runner": "arm", "settings": {"frequency_hz": 1%s}}' % ("0" * 400),
        '{"version": %s}' % ("9" * 5000),
        "[" * 100_000,
    ],
)
def test_a_state_with_huge_numbers_or_depth_is_set_aside(tmp_path: Path, text: str) -> None:
    saved(tmp_path, "leg")
    (tmp_path / "arm.json").write_text(text)
    store = Store(tmp_path)
    assert [state.runner for state in store.load()] == ["leg"]
    assert "it is corrupt" in store.problems[0]


def numbers() -> Iterator[tuple[str, runner_pb2.RunnerSettings]]:
    """Yield each numeric setting, once with a number below its range and once with one above."""
    for field, quantity in quantities.RUNNER.items():
        for value in beyond(quantity, runner_pb2.RunnerSettings.DESCRIPTOR.fields_by_name[field]):
            yield field, runner_pb2.RunnerSettings(**{field: value})
    for field, quantity in quantities.ROS.items():
        for value in beyond(quantity, runner_pb2.RosSettings.DESCRIPTOR.fields_by_name[field]):
            ros = runner_pb2.RosSettings(**{field: value})
            yield field, runner_pb2.RunnerSettings(ros=ros)
    yield "cpu", runner_pb2.RunnerSettings(cpu=-2)


def beyond(quantity: quantities.Quantity, field: FieldDescriptor) -> list[Any]:
    if field.cpp_type == FieldDescriptor.CPPTYPE_DOUBLE:
        return [quantity.low - 1, quantity.high * 2, float("nan"), float("inf")]
    low, high = {
        FieldDescriptor.CPPTYPE_INT32: (-(2**31), 2**31 - 1),
        FieldDescriptor.CPPTYPE_UINT32: (0, 2**32 - 1),
        FieldDescriptor.CPPTYPE_INT64: (-(2**63), 2**63 - 1),
        FieldDescriptor.CPPTYPE_UINT64: (0, 2**64 - 1),
    }[field.cpp_type]
    wanted = [int(quantity.low) - 1, int(quantity.high) + 1]
    return [value for value in wanted if low <= value <= high]


@pytest.mark.parametrize("held", [False, True])
@pytest.mark.parametrize(("field", "settings"), numbers())
def test_a_state_with_a_number_out_of_range_is_set_aside(
    tmp_path: Path, field: str, settings: runner_pb2.RunnerSettings, held: bool
) -> None:
    saved(tmp_path, "leg")
    document = json.loads(saved(tmp_path, "arm"))
    bad = json_format.MessageToDict(settings, preserving_proto_field_name=True)
    if held:
        document["hold"] = {"token": "t", "holder": "h", "added": False, "settings": bad}
    else:
        document["settings"] = bad
    (tmp_path / "arm.json").write_text(json.dumps(document))
    store = Store(tmp_path)
    assert [state.runner for state in store.load()] == ["leg"]
    (problem,) = store.problems
    assert problem.startswith(f"state {tmp_path}/arm.json is set aside as arm.corrupt-")
    assert "is out of range: " in problem or "CPU -2 does not exist" in problem
    assert field.split("_")[0] in problem.lower() and "\n" not in problem


def test_a_state_keeps_a_cpu_that_this_machine_does_not_have(tmp_path: Path) -> None:
    document = json.loads(saved(tmp_path, "arm"))
    document["settings"] = {"cpu": 999}
    (tmp_path / "arm.json").write_text(json.dumps(document))
    store = Store(tmp_path)
    (state,) = store.load()
    assert (state.chosen.cpu, store.problems) == (999, [])


@pytest.mark.parametrize("value", [-5, 0, "NaN", 1e9])
def test_a_handover_with_a_number_out_of_range_is_not_used(
    tmp_path: Path, value: object, caplog: pytest.LogCaptureFixture
) -> None:
    defaults = runner_settings.defaults(runner_pb2.REALTIME_REQUIRED)
    handover.write(tmp_path, Handover(defaults))
    assert handover.read(tmp_path) == Handover(defaults)
    (file,) = tmp_path.iterdir()
    document = json.loads(file.read_text())
    document["defaults"]["frequency_hz"] = value
    file.write_text(json.dumps(document))
    assert handover.read(tmp_path) is None
    assert f"cannot use {file}: runners stay as they are" in caplog.text


def test_an_invalid_history_line_does_not_invalidate_the_state(tmp_path: Path) -> None:
    saved(tmp_path, "arm")
    with (tmp_path / "arm.history").open("a") as history:
        history.write(
            "[" * 100_000 + "\n[]\n" + '{"before": null, "value": {"int_value": 1e400}}\n'
        )
    store = Store(tmp_path)
    (state,) = store.load()
    assert len(state.history.of()) == 1
    assert store.problems == []

"""The history of parameter changes with user and time: stored, bounded, undone."""

import os
import signal
from collections import defaultdict
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
import rtcf
from daemon_process import wait_for
from daemon_under_test import DaemonUnderTest
from hypothesis import given, seed
from hypothesis import strategies as st
from rtcf.v1 import control_pb2, graph_pb2
from rtcfd.operations import parameters
from rtcfd.state import history
from rtcfd.state.desired import Desired
from rtcfd.state.history import History
from rtcfd.state.store import Store
from strangers import open_to_strangers, root_only, stranger

SEED = int(os.environ.get("RTCF_SEED", "1"))

steps = st.one_of(
    st.tuples(
        st.just("set"), st.sampled_from("ab"), st.dictionaries(st.sampled_from("xyz"), st.floats(),
                                                               min_size=1)
    ),
    st.tuples(st.just("undo"), st.sampled_from("ab"), st.none()),
    st.tuples(st.just("restart"), st.none(), st.none()),
)  # fmt: skip


def value(number: float) -> graph_pb2.ParameterValue:
    return graph_pb2.ParameterValue(double_value=number)


@seed(SEED)
@given(st.lists(steps, max_size=60))
def test_changes_are_undone_in_reverse_order(sequence: list[tuple]) -> None:  # type: ignore[type-arg]
    changes = History()
    disk = ""
    model: dict[str, list[dict[str, str]]] = defaultdict(list)  # changes not undone
    for what, component, values in sequence:
        if what == "set":
            changes.note(
                component, [(each, None, value(number)) for each, number in values.items()],
                "ann", "set",
            )  # fmt: skip
            model[component].append({each: str(value(values[each])) for each in values})
        elif what == "undo":
            found = changes.to_take_back(component)
            expected = model[component].pop() if model[component] else {}
            assert {each.parameter: str(each.value) for each in found} == expected
            if found:
                back = [(each.parameter, each.value, value(0.0)) for each in found]
                changes.note(component, back, "bob", "undo", found[0].number)
        else:
            new, anew = changes.to_write()
            disk = history.text(new) if anew else disk + history.text(new)
            before = [str(each) for each in changes.of()]
            changes = History()
            changes.read(disk)
            assert [str(each) for each in changes.of()] == before


def test_many_changes_of_one_component_displace_no_others() -> None:
    changes = History()
    changes.note("/quiet", [("kp", None, value(1.0))], "ann", "set")
    for number in range(10 * history.MOST):
        changes.note("/busy", [("kp", None, value(number))], "ann", "set")
    assert len(changes.of("/busy")) == history.MOST_OF_A_COMPONENT
    assert len(changes.of("/quiet")) == 1


def test_the_total_is_bounded_and_the_oldest_change_is_dropped() -> None:
    changes = History()
    for number in range(history.MOST + 10):
        changes.note(f"/c{number}", [("kp", None, value(number))], "ann", "set")
    found = changes.of()
    assert (len(found), found[0].component) == (history.MOST, "/c10")


def test_undo_finds_all_of_a_change_however_many_changes_follow() -> None:
    changes = History()
    names = [f"taps_{k}" for k in range(2 * history.MOST_OF_A_COMPONENT)]
    changes.note("/fir", [(each, value(0.0), value(1.0)) for each in names], "ann", "set")
    assert [each.parameter for each in changes.to_take_back("/fir")] == names
    for number in range(13):
        changes.note("/iir", [(f"b_{k}", None, value(number)) for k in range(16)], "ann", "set")
    undone = 0
    while last := changes.to_take_back("/iir"):
        assert len(last) == 16
        back = [(each.parameter, each.value, value(0.0)) for each in last]
        changes.note("/iir", back, "ann", "undo", last[0].number)
        undone += 1
    assert undone >= 6


notes = st.lists(st.tuples(st.sampled_from("abc"), st.integers(1, 12)), max_size=40)


@seed(SEED)
@given(notes)
def test_only_whole_changes_are_dropped_and_never_the_newest(
    sequence: list[tuple[str, int]],
) -> None:
    with pytest.MonkeyPatch.context() as limits:
        limits.setattr(history, "MOST_OF_A_COMPONENT", 10)
        limits.setattr(history, "MOST", 20)
        changes = History()
        for number, (component, size) in enumerate(sequence, 1):
            changes.note(component, [(f"p{k}", None, value(k)) for k in range(size)], "a", "set")
            kept: dict[int, int] = defaultdict(int)
            of: dict[str, int] = defaultdict(int)
            for each in changes.of():
                kept[each.number] += 1
                of[each.component] += 1
            assert all(sequence[k - 1][1] == found for k, found in kept.items())
            assert kept[number] == size
            assert of[component] <= 10 or of[component] == size
            assert sum(of.values()) <= 20
            again = History()
            again.read(history.text(changes.of()))
            assert again.of() == changes.of()


def test_the_file_is_bounded(tmp_path: Path) -> None:
    store = Store(tmp_path)
    desired = Desired("arm")
    store.save("arm", store.text(desired), False)
    lines = 0
    for number in range(30):
        changes = [("kp", None, value(number))] * (history.MOST // 10)
        desired.history.note("/a", changes, "ann", "set")
        store.save_history("arm", *desired.history.to_write())
        lines = max(lines, len((tmp_path / "arm.history").read_text().splitlines()))
    assert lines <= 2 * history.MOST
    (again,) = store.load()
    assert [str(each) for each in again.history.of()] == [str(e) for e in desired.history.of()]
    store.remove("arm")
    assert not list(tmp_path.iterdir())


def test_unwritten_changes_are_written_the_next_time() -> None:
    changes = History()
    changes.note("/a", [("kp", None, value(1.0))], "ann", "set")
    changes.to_write()
    changes.not_written()
    changes.note("/a", [("kp", value(1.0), value(2.0))], "ann", "set")
    found, anew = changes.to_write()
    assert (anew, len(found)) == (True, 2)
    assert changes.to_write() == ([], False)


def test_invalid_lines_are_skipped(tmp_path: Path) -> None:
    store = Store(tmp_path)
    store.save("arm", store.text(Desired("arm")), False)
    good = History()
    good.note("/a", [("kp", value(1.0), value(2.0))], "ann", "set")
    torn = history.text(good.of())[:-20]
    (tmp_path / "arm.history").write_text(
        "[]\n7\n{}\n\0\nnull\n" + history.text(good.of()) + torn, encoding="utf-8"
    )
    (found,) = store.load()
    assert [each.parameter for each in found.history.of()] == ["kp"]
    assert not store.problems


def kp(client: rtcf.Client) -> float:
    return float(client.get_component("pid").parameters[0].value.double_value)


def test_changes_are_undone_step_by_step_even_after_a_restart(
    daemon: DaemonUnderTest, client: rtcf.Client
) -> None:
    client.load(rtcf.component("demo", "Fine", name="pid", parameters=["kp:=1.5"]))
    for text in ("kp:=2.5", "kp:=3.5"):
        client.set_parameters("pid", [rtcf.parse_parameter(text)])
    assert "kp = 2.5, as before root changed it" in "".join(client.undo_parameters("pid").notes)
    assert kp(client) == 2.5
    daemon.end()
    daemon.start()
    with daemon.client() as again:
        again.undo_parameters("pid")
        assert kp(again) == 1.5
        with pytest.raises(rtcf.RefusedError, match=r"/pid.kp came with the component \(load by"):
            again.undo_parameters("pid")
        assert [
            (each.how, each.who, each.HasField("before") and each.before.double_value,
             each.value.double_value)
            for each in again.get_history("pid", "kp")
        ] == [
            ("load", "root", False, 1.5),
            ("set", "root", 1.5, 2.5),
            ("set", "root", 2.5, 3.5),
            ("undo", "root", 3.5, 2.5),
            ("undo", "root", 2.5, 1.5),
        ]  # fmt: skip
        assert [each.how for each in again.get_history(most=2)] == ["undo", "undo"]
        assert not again.get_history("pid", "ki")
    shown = daemon.ctl("history", "pid", "-n", "2").stdout.splitlines()
    assert len(shown) == 3
    assert all(len(line) <= 80 for line in shown)
    assert "/pid.kp" in shown[2]


def test_a_value_that_came_with_a_replacement_is_undone(client: rtcf.Client) -> None:
    client.load(rtcf.component("demo", "Fine", name="pid"))
    default = kp(client)
    client.replace("pid", rtcf.component("demo", "Fine", name="pid", parameters=["kp:=7.0"]))
    assert kp(client) == 7.0
    (change,) = client.get_history("pid")
    assert (change.how, change.before.double_value) == ("replace", default)
    client.undo_parameters("pid")
    assert kp(client) == default


def test_a_parameter_changed_since_is_not_undone(client: rtcf.Client) -> None:
    client.load(rtcf.component("demo", "Fine", name="pid"))
    client.set_parameters("pid", [rtcf.parse_parameter("kp:=2.5")])
    client.unload(["pid"])
    client.load(rtcf.component("demo", "Fine", name="pid"))
    with pytest.raises(rtcf.RefusedError, match="it was changed otherwise since"):
        client.undo_parameters("pid")
    with pytest.raises(rtcf.RefusedError, match="no change of parameters of /other"):
        client.undo_parameters("other")


def test_apply_records_its_changes(client: rtcf.Client) -> None:
    for text in ("kp:=1.5", "kp:=1.5", "kp:=2.0"):
        spec = rtcf.component("demo", "Fine", name="pid", parameters=[text])
        client._connection.change(
            client._stub.Apply, control_pb2.ApplyRequest(components=[spec]), None
        )
    assert [each.value.double_value for each in client.get_history("pid")] == [1.5, 2.0]


def test_a_launch_is_named(client: rtcf.Client) -> None:
    spec = rtcf.component("demo", "Fine", name="pid", parameters=["kp:=1.5"])
    opening = control_pb2.OpenLease(component=spec, holder="launch of ann")
    lease = client.lease_component(opening)
    wait_for(lambda: client.get_history(), "the change")
    (change,) = client.get_history("pid")
    assert (change.who, change.how) == ("launch of ann", "launch")
    lease.end()


def test_a_change_without_its_client_is_recorded_with_its_user(
    stopped_daemon: DaemonUnderTest, tmp_path: Path
) -> None:
    held = tmp_path / "held"
    held.mkdir()
    stopped_daemon.environment["PEER_HELD"] = str(held)
    stopped_daemon.start()
    with stopped_daemon.client() as client:
        client.load(rtcf.component("demo", "Fine", name="pid"))
        (held / "set_parameters").touch()
        request = control_pb2.SetParametersRequest(
            component="pid", parameters=[rtcf.parse_parameter("kp:=2.5")]
        )
        call = client._stub.SetParameters(request)
        wait_for((held / "set_parameters waits").exists, "the change")
        call.cancel()
        (held / "set_parameters").unlink()
        wait_for(lambda: client.get_history("pid"), "the note")
        assert client.get_history("pid")[0].who == "root"
    wait_for(lambda: "/pid: kp = 2.5 set by root" in stopped_daemon.log(), "the log")
    assert stopped_daemon.end(signal.SIGTERM) == 0


UNDO = """
import sys, rtcf
with rtcf.Client(sys.argv[1]) as client:
    for _ in range(2):
        try:
            client.undo_parameters("pid")
            print("undone", flush=True)
        except rtcf.RtcfError as error:
            print(error, flush=True)
    print(len(client.get_history()), flush=True)
"""


@root_only
def test_undo_needs_the_same_rights_as_set() -> None:
    rules = (
        "[access]\nobserve = ['nobody']\n"
        "[[access.parameters]]\nwho = ['nobody']\nnames = ['/pid.kp']\nmost_per_s = 0.5\n"
    )
    with open_to_strangers(rules) as daemon:
        daemon.package("demo", types={"Fine": "fine"})
        with daemon.client() as client:
            client.load(rtcf.component("demo", "Fine", name="pid"))
            for text in ("kp:=9.0", "kp:=9.1"):
                client.set_parameters("pid", [rtcf.parse_parameter(text)])
        with stranger(UNDO, str(daemon.socket), user="nobody") as process:
            assert process.stdout is not None
            said = [process.stdout.readline() for _ in range(3)]
    assert said[0] == "undone\n"
    assert "/pid.kp may change by 0.5 a second" in said[1]
    assert said[2] == "3\n"


def test_long_texts_are_bounded_and_simultaneous_changes_stay_together() -> None:
    changes, disk = History(), 0
    for number in range(40):
        for component in "abcdefghijkl":
            text = graph_pb2.ParameterValue(string_value=f"{number:03}" + "x" * 65000)
            changes.note(component, [(name, text, text) for name in "pqr"], "ann", "set")
            new, anew = changes.to_write()
            disk = (0 if anew else disk) + len(history.text(new))
    kept = changes.of()
    assert sum(each.value.ByteSize() * 2 for each in kept) <= history.MOST_BYTES
    assert disk <= 3 * history.MOST_BYTES
    for component in "hijkl":
        last = changes.to_take_back(component)
        assert [each.parameter for each in last] == ["p", "q", "r"]
        assert last[0].value.string_value.startswith("039")
    # Larger than a component's share: it is stored whole, and alone.
    changes.note("l", [(f"p{each}", text, text) for each in range(15)], "ann", "set")
    assert len(changes.of("l")) == 15


def test_an_answer_has_the_newest_changes_that_fit() -> None:
    desired = Desired("r")
    text = graph_pb2.ParameterValue(string_value="x" * 65000)
    for number in range(8):
        for component in "abcdefgh":
            desired.history.note(f"/{component}", [(f"p{number}", text, text)], "ann", "set")
    runner: Any = SimpleNamespace(desired=desired)
    answer = parameters.history(runner, control_pb2.GetHistoryRequest())
    assert 1024 * 1024 < answer.ByteSize() <= 2 * 1024 * 1024
    assert (answer.changes[-1].component, answer.changes[-1].parameter) == ("/h", "p7")
    assert len(answer.changes) < len(desired.history.of())


def test_the_history_of_an_unknown_component_is_rejected(daemon: DaemonUnderTest) -> None:
    assert daemon.ctl("load", "demo", "Fine", "--name", "alpha").returncode == 0
    assert daemon.ctl("set", "alpha", "kp:=2").returncode == 0
    done = daemon.ctl("history", "alhpa")
    assert (done.returncode, done.stderr) == (
        1,
        "rtcfctl: no component /alhpa in runner rt_runner, and no change of one; did you mean "
        '"/alpha"? (components: /alpha)\n',
    )
    assert daemon.ctl("unload", "alpha").returncode == 0
    assert "kp" in daemon.ctl("history", "alpha").stdout, "the history of an unloaded one is kept"

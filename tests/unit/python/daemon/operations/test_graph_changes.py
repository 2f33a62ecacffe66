"""Changes of a graph: errors, kept values, restoration."""

import json
import os
import signal
import threading
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
import rtcf
from daemon_process import wait_for
from daemon_under_test import DaemonUnderTest
from rtcf.v1 import control_pb2, runner_pb2
from rtcfd.state import store


def saved(daemon: DaemonUnderTest, runner: str = "rt_runner") -> dict[str, object]:
    document = json.loads((daemon.state / f"{runner}.json").read_text())
    return {f"{c['ns'].rstrip('/')}/{c['name']}": c for c in document["components"]}


def test_a_loaded_component_is_listed_in_order(client: rtcf.Client) -> None:
    client.load(rtcf.component("demo", "Fine", name="b"))
    result = client.load(rtcf.component("demo", "Fine", name="a", ns="/arm"))
    assert result.component == "/arm/a"
    assert client.get_order() == ["/arm/a", "/b"]
    assert [each.full_name for each in client.list_components()] == ["/arm/a", "/b"]
    assert [each.name for each in client.list_connections()] == ["/arm/a_out", "/b_out"]


def test_relative_names_are_resolved_in_the_root(client: rtcf.Client) -> None:
    client.load(rtcf.component("demo", "Fine", name="a"))
    assert client.get_component("a").full_name == "/a"
    client.unload(["a"])
    assert client.get_order() == []


@pytest.mark.parametrize(
    ("package", "type_name", "code", "text"),
    [
        ("demmo", "Fine", "NOT_FOUND", r'no package "demmo" .*did you mean "demo"\?'),
        ("demo", "Fin", "NOT_FOUND", r'no type "Fin" .*did you mean "Fine"\?.*Crashes, Fine'),
        ("../demo", "Fine", "INVALID_ARGUMENT", "package name"),
        ("demo", "a/b", "INVALID_ARGUMENT", "type name"),
        ("demo", "Refused", "FAILED_PRECONDITION", r"Refused\.configure failed"),
    ],
)
def test_a_failed_load_changes_nothing(
    daemon: DaemonUnderTest,
    client: rtcf.Client,
    package: str,
    type_name: str,
    code: str,
    text: str,
) -> None:
    with pytest.raises(rtcf.RefusedError, match=text) as refused:
        client.load(rtcf.component(package, type_name))
    assert refused.value.code == code
    assert client.get_order() == []
    assert not (daemon.state / "rt_runner.json").exists()


def test_unknown_package_lists_the_folders(daemon: DaemonUnderTest, client: rtcf.Client) -> None:
    with pytest.raises(rtcf.RefusedError) as refused:
        client.load(rtcf.component("nothing_like_it", "Fine"))
    assert str(daemon.packages) in str(refused.value)
    assert "/usr/lib/rtcf" in str(refused.value)


def test_a_type_in_two_folders_is_reported(daemon: DaemonUnderTest, client: rtcf.Client) -> None:
    daemon.package("demo", "elsewhere", types={"Fine": "fine"})
    (note,) = client.load(rtcf.component("demo", "Fine")).notes
    taken, other = (daemon.packages / "demo" / f"{name}.so" for name in ("elsewhere", "main"))
    assert note == f"several libraries provide demo/Fine: rtcfd uses {taken}, not {other}"


def test_a_launch_gets_a_note_once(daemon: DaemonUnderTest, client: rtcf.Client) -> None:
    daemon.package("demo", "elsewhere", types={"Fine": "fine"})

    def leased(name: str) -> tuple[tuple[rtcf.Lease, Iterator[Any]], list[str]]:
        spec = rtcf.component("demo", "Fine", name=name)
        lease = client.lease_component(control_pb2.OpenLease(component=spec))
        messages = iter(lease)
        loaded = next(each.loaded for each in messages if each.WhichOneof("kind") == "loaded")
        return (lease, messages), list(loaded.notes)

    def end(lease: rtcf.Lease, messages: Iterator[Any]) -> None:
        lease.end()
        assert [each.WhichOneof("kind") for each in messages][-1] == "ended"

    first, told = leased("one")
    assert len(told) == 1 and "several libraries provide demo/Fine" in told[0]
    second, nothing = leased("two")
    assert nothing == []
    end(*first)
    end(*second)
    third, again = leased("three")  # from another launch
    assert again == told
    end(*third)


def test_a_duplicate_name_is_rejected(client: rtcf.Client) -> None:
    client.load(rtcf.component("demo", "Fine"))
    with pytest.raises(rtcf.RefusedError, match="/Fine is there already") as refused:
        client.load(rtcf.component("demo", "Fine"))
    assert refused.value.code == "ALREADY_EXISTS"


def test_a_library_that_does_not_load_reports_the_loaders_text(
    daemon: DaemonUnderTest, client: rtcf.Client
) -> None:
    library = daemon.package("bad", problem="undefined symbol: _ZN3FooE")
    with pytest.raises(rtcf.RefusedError, match="undefined symbol: _ZN3FooE") as refused:
        client.load(rtcf.component("bad", "Foo"))
    assert refused.value.code == "FAILED_PRECONDITION"
    assert str(library) in str(refused.value)
    assert client.list_types("bad").problems == [f"{library}: undefined symbol: _ZN3FooE"]


def test_a_library_that_crashes_is_rejected_with_its_signal(
    daemon: DaemonUnderTest, client: rtcf.Client
) -> None:
    daemon.package("bad", crash="SIGSEGV")
    with pytest.raises(rtcf.RefusedError, match="was killed by SIGSEGV"):
        client.load(rtcf.component("bad", "Foo"))


def test_a_repaired_library_is_noticed(daemon: DaemonUnderTest, client: rtcf.Client) -> None:
    daemon.package("late", types={"Old": "fine"})
    assert [each.type for each in client.list_types("late").types] == ["Old"]
    daemon.package("late", types={"Newer": "fine"})
    assert [each.type for each in client.list_types("late").types] == ["Newer"]


def test_a_crash_during_load_is_reported_and_not_saved(
    daemon: DaemonUnderTest, client: rtcf.Client
) -> None:
    client.load(rtcf.component("demo", "Fine"))
    with pytest.raises(
        rtcf.RefusedError, match=r"was killed by SIGSEGV .* while /Crashes\.configure was running"
    ):
        client.load(rtcf.component("demo", "Crashes"))
    wait_for(lambda: "executor restarted in" in daemon.log(), "the recovery")
    assert client.get_order() == ["/Fine"]
    assert list(saved(daemon)) == ["/Fine"]


def test_progress_is_streamed_while_stop_and_queries_work(
    daemon: DaemonUnderTest, client: rtcf.Client, tmp_path: Path
) -> None:
    go = tmp_path / "go"
    lines: list[str] = []
    results: list[control_pb2.ChangeResult] = []
    slow = rtcf.component("demo", "Slow", parameters=[f"until:='{go}'"])
    loading = threading.Thread(
        target=lambda: results.append(client.load(slow, on_progress=lines.append))
    )
    loading.start()
    wait_for(lambda: lines == ["configuring Slow"], "progress")
    assert client.get_order() == []
    client.stop()
    assert client.get_status().runners[0].state == runner_pb2.RUNNER_STATE_STOPPED
    go.touch()
    loading.join()
    assert results[0].component == "/Slow"


def test_a_change_continues_without_its_client(
    daemon: DaemonUnderTest, client: rtcf.Client, tmp_path: Path
) -> None:
    go = tmp_path / "go"
    slow = rtcf.component("demo", "Slow", parameters=[f"until:='{go}'"])

    class Enough(Exception):
        pass

    def leave(_: str) -> None:
        raise Enough

    with daemon.client() as hasty, pytest.raises(Enough):
        hasty.load(slow, on_progress=leave)
    wait_for(lambda: daemon.executor_pid(), "an answer")
    go.touch()
    wait_for(lambda: client.get_order() == ["/Slow"], "the load")
    wait_for(lambda: "its caller had disconnected" in daemon.log(), "the log")
    assert list(saved(daemon)) == ["/Slow"]


def test_a_replacement_inherits_unset_fields(daemon: DaemonUnderTest, client: rtcf.Client) -> None:
    old = rtcf.component(
        "demo", "Fine", name="x", ns="/arm", remaps=["in1:=/a"], first=True, breaks=["in2"],
        parameters=["k:=1"],
    )  # fmt: skip
    client.load(old)
    result = client.replace("/arm/x", rtcf.component("demo", "Logs"))
    assert result.component == "/arm/x"
    spec = client.get_component("/arm/x").spec
    assert (spec.type, spec.first, list(spec.breaks)) == ("Logs", True, ["in2"])
    assert [each.target for each in spec.remaps] == ["/a"]
    assert not spec.parameters
    assert list(saved(daemon)) == ["/arm/x"]


def test_the_graph_is_restored_held_after_a_restart(
    daemon: DaemonUnderTest, client: rtcf.Client
) -> None:
    client.set_runner(runner_pb2.RunnerSettings(frequency_hz=250.0))
    client.load(rtcf.component("demo", "Fine", name="a", parameters=["k:=1"]))
    client.load(rtcf.component("demo", "Fine", name="b"))
    client.load(rtcf.component("demo", "Fine", name="c"))
    client.unload(["b"])
    client.set_parameters("a", [rtcf.parse_parameter("k:=2.5")])
    client.set_breaks([rtcf.parse_port("a.in1"), rtcf.parse_port("c.in1")], True)
    client.set_breaks([rtcf.parse_port("c.in1")], False)
    client.add_runner("arm")
    client.start()
    daemon.end()

    daemon.start()
    with daemon.client() as again:
        arm, default = again.get_status().runners
        assert (arm.runner, default.runner) == ("arm", "rt_runner")
        assert default.state == runner_pb2.RUNNER_STATE_STOPPED
        assert default.settings.frequency_hz == 250.0
        assert again.get_order() == ["/a", "/c"]
        spec = again.get_component("a").spec
        assert [each.value.double_value for each in spec.parameters] == [2.5]
        assert list(spec.breaks) == ["in1"]
        assert not again.get_component("c").spec.breaks


def test_components_that_cannot_be_restored_are_left_out_and_reported(
    daemon: DaemonUnderTest, client: rtcf.Client
) -> None:
    daemon.package("gone", types={"Gone": "fine"})
    client.load(rtcf.component("gone", "Gone"))
    client.load(rtcf.component("demo", "Fine"))
    daemon.end()
    (daemon.packages / "gone" / "main.so").unlink()

    daemon.start()
    with daemon.client() as again:
        assert again.get_order() == ["/Fine"]
        assert '/Gone is left out: no package "gone"' in again.get_status().runners[0].status
        assert set(saved(daemon)) == {"/Fine", "/Gone"}
        again.unload(["Gone"])
        assert again.get_status().runners[0].status == ""
        assert set(saved(daemon)) == {"/Fine"}


def test_a_component_can_be_unloaded_without_executor(
    daemon: DaemonUnderTest, client: rtcf.Client
) -> None:
    client.load(rtcf.component("demo", "Fine", name="a"))
    client.load(rtcf.component("demo", "Fine", name="b"))
    works = daemon.executor.read_text()
    daemon.executor.write_text("#!/bin/sh\nexit 7\n")
    os.kill(daemon.executor_pid(), signal.SIGKILL)
    wait_for(
        lambda: client.get_status().runners[0].state == runner_pb2.RUNNER_STATE_DOWN, "its death"
    )
    with pytest.raises(rtcf.RefusedError, match="no component /c"):
        client.unload(["c"])
    assert client.unload(["a"]).notes == ["removed from the saved graph only"]
    daemon.executor.write_text(works)
    assert client.start().order == ["/b"]


@pytest.mark.parametrize(
    "content",
    ["{", "[]", '{"version": 0}', '{"version": 1}', "\xff", "[" * 5000 + "]" * 5000],
    ids=["cut", "a list", "version 0", "nothing in it", "no text", "deep"],
)
def test_a_corrupt_state_is_set_aside(stopped_daemon: DaemonUnderTest, content: str) -> None:
    stopped_daemon.state.mkdir()
    (stopped_daemon.state / "rt_runner.json").write_text(content, encoding="latin-1")
    stopped_daemon.start()
    assert "is corrupt" in stopped_daemon.log()
    (aside,) = stopped_daemon.state.iterdir()
    assert aside.name.startswith("rt_runner.corrupt-")
    assert aside.read_text(encoding="latin-1") == content
    assert stopped_daemon.executor_pid()
    assert f"set aside as {aside.name}" in stopped_daemon.ctl("status").stdout


def test_the_state_of_a_newer_rtcfd_is_set_aside(stopped_daemon: DaemonUnderTest) -> None:
    stopped_daemon.state.mkdir()
    content = f'{{"version": {store.VERSION + 1}, "runner": "rt_runner", "more": []}}'
    (stopped_daemon.state / "rt_runner.json").write_text(content)
    stopped_daemon.start()
    (aside,) = stopped_daemon.state.iterdir()
    assert aside.name.startswith("rt_runner.newer-")
    assert aside.read_text() == content
    said = stopped_daemon.ctl("status").stdout
    assert f"it is of version {store.VERSION + 1}, of a newer rtcfd than this" in said


# The format of rtcfd before components could be left out, quarantined and held.
OLDEST = """\
{
  "version": 1,
  "runner": "rt_runner",
  "settings": {"frequency_hz": 250.0},
  "components": [
    {"package": "demo", "type": "Fine", "name": "a", "ns": "/"}
  ]
}
"""


def test_the_state_of_an_older_rtcfd_is_upgraded_and_kept(stopped_daemon: DaemonUnderTest) -> None:
    stopped_daemon.state.mkdir()
    (stopped_daemon.state / "rt_runner.json").write_text(OLDEST)
    stopped_daemon.start()
    assert "is of version 1: upgraded, kept as rt_runner.version-1" in stopped_daemon.log()
    assert (stopped_daemon.state / "rt_runner.version-1").read_text() == OLDEST
    with stopped_daemon.client() as client:
        assert client.get_order() == ["/a"]
        assert client.get_status().runners[0].settings.frequency_hz == 250.0
        client.load(rtcf.component("demo", "Fine", name="b"))
    saved = stopped_daemon.saved()
    assert saved["version"] == store.VERSION
    assert [each["name"] for each in saved["components"]] == ["a", "b"]


def test_a_change_that_cannot_be_saved_stays_with_a_note(
    daemon: DaemonUnderTest, client: rtcf.Client
) -> None:
    daemon.state.rmdir()
    result = client.load(rtcf.component("demo", "Fine"))
    assert result.notes == ["not saved: No such file or directory"]
    assert client.get_order() == ["/Fine"]
    assert "not saved" in client.get_status().runners[0].status
    daemon.state.mkdir()
    assert not client.unload(["Fine"]).notes
    assert client.get_status().runners[0].status == ""

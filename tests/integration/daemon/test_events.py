"""Events of a real rtcfd: in order, from a given number on, including faults and crashes."""

import json
import os
import signal
import subprocess
from collections.abc import Callable

import pytest
import rtcf
from daemon_process import BUILD_TREE, DEADLINE_S, Daemon, stopped, wait_for
from fig_1 import mimo
from rtcf.streams.numbered import Lost, NumberedStream, Place
from rtcf.v1 import control_pb2, runner_pb2

Event = control_pb2.Event


def until(
    stream: NumberedStream[control_pb2.Event], condition: Callable[[control_pb2.Event], bool]
) -> list[control_pb2.Event]:
    """Return the events up to a condition; fails if the daemon ends."""
    found = []
    for event in stream:
        assert not isinstance(event, Lost)
        found.append(event)
        if condition(event):
            return found
    raise AssertionError(f"the stream ended: {found}")


def test_changes_and_states_arrive_in_order_with_their_user(client: rtcf.Client) -> None:
    with client.watch_events(["rt_runner"]) as events:
        client.load(mimo("A", {}))
        client.start()
        client.set_breaks([rtcf.parse_port("A.in1")], True)
        client.stop()
        heard = until(events, lambda e: e.kind == Event.KIND_RUNNER_STATE
                      and e.state == runner_pb2.RUNNER_STATE_STOPPED)  # fmt: skip
    asked = (Event.KIND_GRAPH, Event.KIND_RUNNER_STATE)  # a busy machine emits others, too
    assert [(each.kind, each.state) for each in heard if each.kind in asked] == [
        (Event.KIND_GRAPH, runner_pb2.RUNNER_STATE_STOPPED),
        (Event.KIND_RUNNER_STATE, runner_pb2.RUNNER_STATE_RUNNING),
        (Event.KIND_GRAPH, runner_pb2.RUNNER_STATE_RUNNING),
        (Event.KIND_RUNNER_STATE, runner_pb2.RUNNER_STATE_STOPPED),
    ]
    numbers = [each.sequence for each in heard]
    assert numbers == list(range(numbers[0], numbers[0] + len(numbers)))
    assert heard[0].component == "/A"
    assert heard[0].user == "root" or os.geteuid() != 0


def test_a_returning_watcher_misses_nothing(client: rtcf.Client) -> None:
    with client.watch_events() as events:
        place = events.place
    client.load(mimo("A", {}))
    client.unload(["A"])
    with client.watch_events(after=place, until_now=True) as events:
        said = [each.message for each in events if isinstance(each, Event)]
    assert said == ["/A loaded (rtcf_examples/Mimo)", "/A unloaded"]


def test_a_dead_executor_is_an_event(daemon: Daemon, client: rtcf.Client) -> None:
    pid = client.get_status().runners[0].pid
    with client.watch_events() as events:
        os.kill(pid, signal.SIGKILL)
        heard = until(events, lambda e: e.kind == Event.KIND_EXECUTOR_FAULT)
    assert "killed" in heard[-1].message.lower() or "SIGKILL" in heard[-1].message
    assert heard[-1].runner == "rt_runner"
    wait_for(lambda: client.get_status().runners[0].pid not in (0, pid), "a new executor")


def test_rtcfctl_prints_events_as_text_and_json(daemon: Daemon, client: rtcf.Client) -> None:
    client.load(mimo("A", {}))
    lines = daemon.ctl("events").stdout.splitlines()
    assert "rtcfd daemon: rtcfd" in lines[0]
    assert "rt_runner graph: /A loaded (rtcf_examples/Mimo)" in lines[-1]
    documents = [
        json.loads(line) for line in daemon.ctl("events", "-o", "json").stdout.splitlines()
    ]
    assert [each["sequence"] for each in documents] == list(range(1, len(documents) + 1))
    assert documents[-1]["kind"] == "graph"
    assert documents[-1]["component"] == "/A"
    other = daemon.ctl("-r", "nobody", "events", "-o", "json").stdout.splitlines()
    assert {json.loads(line)["kind"] for line in other} == {"daemon"}


def test_ctrl_c_ends_the_following_of_events_in_order(daemon: Daemon, client: rtcf.Client) -> None:
    process = subprocess.Popen(
        [BUILD_TREE / "bin" / "rtcfctl", "events", "-f"],
        env=daemon.environment(), stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
    )  # fmt: skip
    assert process.stdout is not None and process.stdout.readline()
    process.send_signal(signal.SIGINT)
    _, said = process.communicate(timeout=DEADLINE_S)
    assert (process.returncode, said) == (0, "")


def test_options_have_no_abbreviations(daemon: Daemon) -> None:
    done = daemon.ctl("events", "--foll")
    assert (done.returncode, "unrecognized arguments: --foll" in done.stderr) == (2, True)


def test_a_position_from_before_a_restart_of_rtcfd_starts_over(
    daemon: Daemon, client: rtcf.Client
) -> None:
    with client.watch_events(after=Place("another log", 7), until_now=True) as events:
        first = next(iter(events))
    assert isinstance(first, Event)
    assert (first.sequence, first.kind) == (1, Event.KIND_DAEMON)


@pytest.mark.parametrize("runner", ["rt_runner", "other"])
def test_only_events_of_the_requested_runners_are_sent(client: rtcf.Client, runner: str) -> None:
    client.add_runner("other")
    with client.watch_events([runner]) as events:
        client.load(mimo("A", {}), "rt_runner")
        client.load(mimo("A", {}), "other")
        client.unload(["A"], runner)
        heard = until(events, lambda e: e.message.endswith("unloaded"))
    assert {each.runner for each in heard} == {runner}


def test_a_load_event_precedes_its_parameter_events(client: rtcf.Client) -> None:
    knobs = rtcf.component("rtcf_test", "Knobs", name="knobs", parameters=["rate:=2.5"])
    with client.watch_events(["rt_runner"]) as events:
        client.load(knobs)
        heard = until(events, lambda each: each.kind == Event.KIND_PARAMETERS)
        assert [each.message for each in heard] == [
            "/knobs loaded (rtcf_test/Knobs)",
            "/knobs: rate = 2.5 set",
        ]
        client.replace("knobs", rtcf.component("rtcf_test", "Knobs", parameters=["rate:=3.5"]))
        heard = until(events, lambda each: each.kind == Event.KIND_PARAMETERS)
        assert [each.kind for each in heard] == [Event.KIND_GRAPH, Event.KIND_PARAMETERS]


@pytest.mark.skipif(os.geteuid() != 0, reason="requires root")
def test_the_user_of_a_direct_stop_is_named(daemon: Daemon, client: rtcf.Client) -> None:
    client.load(mimo("A", {}))
    client.start()
    with client.watch_events(["rt_runner"]) as events:
        with stopped(daemon.pid):
            assert daemon.ctl("stop").returncode == 0
        heard = until(events, lambda each: "at its executor" in each.message)
    assert heard[-1].user == "root"
    assert heard[-1].message.startswith("stopped at its executor by root (pid ")


def test_non_finite_values_are_reported_again(client: rtcf.Client) -> None:
    client.load(rtcf.component("rtcf_faults", "NotFinite", name="bad", parameters=["after:=50"]))
    with client.watch_events(["rt_runner"]) as events:
        client.start()
        for number in range(2):
            heard = until(events, lambda each: each.kind == Event.KIND_COMPONENT_FAULT)[-1]
            assert heard.component == "/bad"
            assert "output value is not finite: readers keep its last value" in heard.message
            assert ("times since the last report" in heard.message) == (number == 1)
    wait_for(lambda: len(client.list_incidents()) == 2, "an incident of each")

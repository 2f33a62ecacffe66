"""The cycles before a fault, a crash or a stall are kept in a file, despite other activity."""

import json
import os
import random
import signal
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

import numpy as np
import pytest
import rtcf
from daemon_process import NO_ROS, Daemon, wait_for
from rtcf.v1 import graph_pb2, incidents_pb2, runner_pb2
from values import state

SETTINGS = f"[runner]\nstall_timeout_ms = 500\n{NO_ROS}"
FAULTS = ("Throws", "NotFiniteStops", "NullDereference", "NeverReturns")
PACE_S = 11.0  # minimum time between two incidents of a runner


@pytest.fixture
def settings() -> str:
    """Return the settings of an rtcfd with a short stall timeout."""
    return SETTINGS


def faulty(type_name: str, after: int) -> graph_pb2.ComponentSpec:
    return rtcf.component(
        "rtcf_faults", type_name, name="bad", remaps=["in:=/a"], parameters=[f"after:={after}"]
    )


@contextmanager
def hot_swaps(daemon: Daemon) -> Iterator[None]:
    """Load and unload a component repeatedly."""
    done = threading.Event()

    def swap() -> None:
        with rtcf.Client(daemon.socket) as client:
            while not done.is_set():
                try:
                    client.load(rtcf.component("rtcf_test", "Counter", name="guest"))
                    client.unload(["guest"])
                except rtcf.RtcfError:
                    time.sleep(0.05)  # its executor has just died

    swapping = threading.Thread(target=swap)
    swapping.start()
    try:
        yield
    finally:
        done.set()
        swapping.join()


def newest(client: rtcf.Client, known: int) -> incidents_pb2.Incident:
    """Wait for an incident besides the known ones."""
    wait_for(lambda: len(client.list_incidents()) > known, "an incident")
    return client.list_incidents()[-1]


def check_file(incident: incidents_pb2.Incident) -> None:
    """Check that the file has the values of /a.out, each of its own cycle, up to the end."""
    with rtcf.read_recording(incident.file) as recording:
        assert recording.whole
        about = recording.metadata["incident"]
        cycles = recording.cycles
        assert len(cycles) > 10
        assert (np.diff(cycles) == 1).all(), "no cycle is missing"
        assert int(about["cycle"]) - cycles[-1] <= 2, "the frames reach the end"
        column = recording.read("/a.out")
        # The last cycle, in which components make safe, does not count.
        assert (column.values == column.cycles + 1)[:-1].all(), "each value is of its own cycle"
        graph = json.loads(recording.metadata["graph"]["json"])
        assert "a" in {each["name"].strip("/") for each in graph}
        assert about["rtcf"] == about["executor"] != ""
        libraries = recording.metadata["libraries"].values()
        assert any(len(line.split()[-1]) == 40 for line in libraries), "a build id"


def test_each_fault_has_its_file(daemon: Daemon, client: rtcf.Client) -> None:
    for number, type_name in enumerate(FAULTS):
        runner = f"loop{number}"
        client.add_runner(runner)
        client.load(rtcf.component("rtcf_test", "Counter", name="a"), runner)
        client.load(faulty(type_name, 200), runner)
        client.start(runner)
        incident = newest(client, number)
        assert incident.runner == runner
        assert "/bad" in incident.reason
        line = f"incident {incident.name} kept in {incident.file}"
        wait_for(lambda line=line: line in daemon.log(), "the line in the log")  # type: ignore[misc]
        assert daemon.log().count(line) == 1
        assert state(client, runner).incident == incident.name
        check_file(incident)


def test_sigkill_during_hot_swaps_has_its_file(daemon: Daemon, client: rtcf.Client) -> None:
    client.load(rtcf.component("rtcf_test", "Counter", name="a"))
    client.start()
    with hot_swaps(daemon):
        wait_for(lambda: state(client).iteration > 300, "300 cycles")
        os.kill(state(client).pid, signal.SIGKILL)
        incident = newest(client, 0)
    assert "was killed by SIGKILL" in incident.reason
    check_file(incident)


@pytest.mark.long
def test_50_random_incidents_during_hot_swaps_have_their_files(
    daemon: Daemon, client: rtcf.Client
) -> None:
    with hot_swaps(daemon):
        for number in range(50):
            runner = f"loop{number}"
            client.add_runner(runner)
            client.load(rtcf.component("rtcf_test", "Counter", name="a"), runner)
            kind = random.choice([*FAULTS, "SIGKILL"])
            after = random.randint(100, 2000)
            if kind != "SIGKILL":
                client.load(faulty(kind, after), runner)
            client.start(runner)
            if kind == "SIGKILL":
                wait_for(lambda: state(client, runner).iteration > after, f"{after} cycles")  # noqa: B023
                os.kill(state(client, runner).pid, signal.SIGKILL)
            incident = newest(client, number)
            assert incident.runner == runner
            check_file(incident)
            client.remove_runner(runner)


def test_an_incident_of_a_running_loop_is_kept_on_request(
    daemon: Daemon, client: rtcf.Client
) -> None:
    client.load(rtcf.component("rtcf_test", "Counter", name="a"))
    client.load(rtcf.component("rtcf_test", "Knobs", name="knobs", parameters=["rate:=2.5"]))
    client.start()
    client.set_parameters("knobs", [rtcf.parse_parameter("count:=7")])
    wait_for(lambda: state(client).iteration > 100, "100 cycles")
    taken = daemon.ctl("incident", "take", "--reason", "a noise in joint 3")
    assert taken.returncode == 0, taken.stderr
    assert state(client).state == runner_pb2.RUNNER_STATE_RUNNING
    (incident,) = client.list_incidents()
    check_file(incident)
    shown = daemon.ctl("incident", "show").stdout
    for part in ("a noise in joint 3", "rt_runner", "/a.out", "duration µs", "/knobs.count"):
        assert part in shown, shown
    told = json.loads(daemon.ctl("-o", "json", "incident", "show", incident.name).stdout)
    cycles = [each["cycle"] for each in told["last_cycles"]]
    assert len(cycles) == 10
    assert told["values"]["/a.out"] == {"cycle": cycles[-1], "value": cycles[-1] + 1}
    assert incident.name in daemon.ctl("incident", "list").stdout


def test_doctor_names_incidents_that_nobody_has_looked_at(
    daemon: Daemon, client: rtcf.Client
) -> None:
    def said() -> str:
        return daemon.ctl("doctor", "--seconds", "0").stdout

    client.load(rtcf.component("rtcf_test", "Counter", name="a"))
    client.start()
    wait_for(lambda: state(client).iteration > 100, "some cycles")
    assert "incidents: none that nobody has looked at" in said()
    first, second = (client.take_incident(reason=reason) for reason in ("one", "two"))
    assert "incidents: 2 incidents that nobody has looked at; the newest: two" in said()
    assert f"remedy:    rtcfctl incident show {second.name}" in said()
    assert daemon.ctl("incident", "show", second.name).returncode == 0
    assert "incidents: 1 incident that nobody has looked at; the newest: one" in said()
    client.remove_incidents([first.name, second.name])
    assert "incidents: none that nobody has looked at" in said()
    assert list(Path(first.file).parent.iterdir()) == []


def test_a_file_is_exported_and_removed(
    daemon: Daemon, client: rtcf.Client, tmp_path: Path
) -> None:
    client.load(rtcf.component("rtcf_test", "Counter", name="a"))
    client.start()
    incident = client.take_incident()
    to = tmp_path / "copy.mcap"
    assert daemon.ctl("incident", "export", incident.name, "--to", str(to)).returncode == 0
    assert to.read_bytes() == Path(incident.file).read_bytes()
    bag = daemon.ctl("incident", "export", incident.name, "--to", str(to.with_suffix(".bag")))
    assert bag.returncode == 2 and "then `rtcfctl convert" in bag.stderr
    assert not to.with_suffix(".bag").exists()
    again = daemon.ctl("incident", "export", incident.name, "--to", str(to))
    assert again.returncode != 0 and "exists: choose another file" in again.stderr
    refused = daemon.ctl("incident", "rm", incident.name, "other")
    assert refused.returncode == 1 and "no incident other" in refused.stderr
    assert Path(incident.file).exists(), "all of them or none"
    assert daemon.ctl("incident", "rm", incident.name).returncode == 0
    assert not Path(incident.file).exists()
    refused = daemon.ctl("incident", "show")
    assert refused.returncode == 1 and "there are no incidents" in refused.stderr


def test_a_runner_without_executor_has_no_cycles_to_keep(
    daemon: Daemon, client: rtcf.Client
) -> None:
    refused = daemon.ctl("-r", "nobody", "incident", "take")
    assert refused.returncode == 1 and "nobody" in refused.stderr
    with pytest.raises(rtcf.RefusedError, match="there is no incident /etc/passwd"):
        client.remove_incidents(["/etc/passwd"])


def test_the_oldest_incidents_are_removed(tmp_path: Path) -> None:
    daemon = Daemon(tmp_path, f"[limits]\nincidents_mb = 1\n{NO_ROS}")
    daemon.start()
    try:
        with rtcf.Client(daemon.socket) as client:
            client.load(rtcf.component("rtcf_test", "Counter", name="a"))
            client.start()
            first = client.take_incident()
            # The size of a large graph's incident.
            Path(first.file).write_bytes(bytes(1_000_000))
            os.utime(first.file, (1.0, 1.0))
            second = client.take_incident()
            assert not Path(first.file).exists()
            assert Path(second.file).exists()
    finally:
        daemon.end()


def test_the_faulting_cycle_of_a_continuing_loop_is_shown(
    daemon: Daemon, client: rtcf.Client
) -> None:
    client.load(rtcf.component("rtcf_test", "Counter", name="a"))
    bad = faulty("Throws", 200)
    bad.optional = True
    client.load(bad)
    client.start()
    incident = newest(client, 0)
    assert state(client).state == runner_pb2.RUNNER_STATE_RUNNING
    with rtcf.read_recording(incident.file) as recording:
        cycles = recording.cycles
    told = json.loads(daemon.ctl("-o", "json", "incident", "show").stdout)
    assert told["cycle"] in cycles
    assert cycles[-1] > told["cycle"], "the loop went on"
    assert [each["cycle"] for each in told["last_cycles"]] == list(
        range(told["cycle"] - 9, told["cycle"] + 1)
    )
    # It counts its updates and failed in the 201st, whose value nobody reads.
    assert told["values"]["/bad.out"] == {"cycle": told["cycle"], "value": 200}


def test_recent_parameter_changes_are_shown_with_values(
    daemon: Daemon, client: rtcf.Client
) -> None:
    client.load(rtcf.component("rtcf_test", "Knobs", name="knobs"))
    client.set_parameters("knobs", [rtcf.parse_parameter("count:=7")])
    client.set_parameters("knobs", [rtcf.parse_parameter("label:=xyz")])
    client.take_incident()
    shown = daemon.ctl("incident", "show").stdout
    assert "/knobs.count 2 -> 7 by " in shown, shown
    assert "/knobs.label abc -> xyz by " in shown, shown


def test_the_parameter_change_that_killed_an_executor_is_shown(
    daemon: Daemon, client: rtcf.Client
) -> None:
    client.load(rtcf.component("rtcf_test", "Counter", name="a"))
    client.load(faulty("NullDereference", 1_000_000_000))
    client.start()
    wait_for(lambda: state(client).iteration > 100, "100 cycles")
    # It may or may not answer before it dies.
    with suppress(rtcf.RtcfError):
        client.set_parameters("bad", [rtcf.parse_parameter("after:=0")])
    newest(client, 0)
    shown = daemon.ctl("incident", "show").stdout
    assert "/bad.after 1000000000 -> 0 by " in shown, shown
    assert "/bad: after = 0 set" in daemon.log()
    changes = client.get_history("bad")
    assert changes[-1].value.int_value == 0

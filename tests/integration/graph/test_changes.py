"""Changes of the graph while its loop runs at 1 kHz: no cycle is missed, and unchanged
components keep their values."""

import json

import fig_1
import pytest
import rtcf
from daemon_process import Daemon, wait_for
from rtcf.v1 import control_pb2, graph_pb2, runner_pb2
from values import iteration, parameter_values, port_value, wait_until_after

ROUNDS = 20


def test_the_history_has_the_value_in_the_type_of_the_parameter(client: rtcf.Client) -> None:
    client.load(rtcf.component("rtcf_test", "Knobs", name="knobs"))
    client.set_parameters("knobs", [rtcf.parse_parameter("rate:=2")])
    change = client.get_history("knobs")[-1]
    assert change.value.WhichOneof("kind") == "double_value"
    assert change.value.double_value == 2.0


def _counter(name: str) -> graph_pb2.ComponentSpec:
    return rtcf.component(
        "rtcf_test", "Counter", name=name, remaps=[f"in:=/{name}/in", f"out:=/{name}/out"]
    )


def _ports(text: str) -> list[control_pb2.PortName]:
    return [rtcf.parse_port(text)]


def test_no_cycle_is_missed_and_unchanged_components_keep_their_values(client: rtcf.Client) -> None:
    client.set_runner(runner_pb2.RunnerSettings(frequency_hz=1000.0))
    client.load(_counter("stays"))
    fig_1.load(client)
    client.start()
    seen = iteration(client)
    for _ in range(ROUNDS):
        client.load(_counter("guest"))
        client.load(fig_1.mimo("spy", {"in1": "/R3_G2H1"}))
        # R2 reads F1's values of the previous cycle, then those of the present cycle again.
        client.set_breaks(_ports("R2.in1"), True)
        assert client.get_order().index("/R2") < client.get_order().index("/R3")
        client.set_breaks(_ports("R2.in1"), False)
        client.replace("guest", _counter("guest"))
        client.replace("R1", fig_1.mimo("R1", fig_1.WIRES["R1"]))
        client.unload(["guest", "spy"])
        assert client.get_order() == ["/H1", "/F1", "/R1", "/R2", "/R3", "/stays"]
        seen = wait_until_after(client, seen)
    assert client.get_status("rt_runner").runners[0].state == runner_pb2.RUNNER_STATE_RUNNING
    client.stop()
    # It was updated in each cycle and never restarted.
    assert port_value(client, "stays", "out") == iteration(client)


def test_a_replacement_starts_from_scratch(client: rtcf.Client) -> None:
    client.load(_counter("old"))
    client.start()
    wait_for(lambda: port_value(client, "old", "out") > 500, "500 cycles")
    client.replace("old", _counter("young"))
    client.stop()
    assert client.get_order() == ["/young"]
    cycles = iteration(client)
    assert 0 < port_value(client, "young", "out") <= cycles - 500


def test_an_input_keeps_its_value_when_its_writer_leaves(client: rtcf.Client) -> None:
    client.load(rtcf.component("rtcf_examples", "Mimo", name="source", remaps=["out1:=/x"]))
    client.load(rtcf.component("rtcf_examples", "Identity", name="sink", remaps=["in:=/x"]))
    client.start()
    wait_for(lambda: port_value(client, "sink", "out") == 1.0, "a value")
    client.unload(["source"])
    before = iteration(client)
    wait_for(lambda: iteration(client) > before + 10, "cycles without the source")
    assert port_value(client, "sink", "in") == 1.0
    (port,) = (each for each in client.get_component("sink").ports if each.name == "in")
    assert not port.connected


def test_a_broken_input_reads_the_previous_cycle(daemon: Daemon, client: rtcf.Client) -> None:
    # A ramp: /x grows by one per cycle.
    client.load(fig_1.mimo("ramp", {"in1": "/x", "out1": "/x", "in2": "/one"}, first=True))
    client.load(fig_1.mimo("one", {"out1": "/one"}))
    client.load(fig_1.mimo("reader", {"in1": "/x", "out1": "/y"}))
    client.step(100)
    ramp = port_value(client, "ramp", "out1")
    assert port_value(client, "reader", "out1") == ramp
    assert daemon.ctl("break", "reader.in1").returncode == 0
    client.step(100)
    assert port_value(client, "ramp", "out1") == ramp + 100
    assert port_value(client, "reader", "out1") == ramp + 99
    connections = json.loads(daemon.ctl("connections", "-o", "json").stdout)
    (x,) = (each for each in connections if each["name"] == "/x")
    assert {end["component"]: end["broken"] for end in x["readers"]} == {
        "/ramp": True,
        "/reader": True,
    }
    assert "/reader.in1 (loop break)" in daemon.ctl("connections").stdout
    assert daemon.ctl("unbreak", "reader.in1").returncode == 0
    client.step(100)
    assert port_value(client, "reader", "out1") == ramp + 200


def test_parameters_change_while_the_loop_runs(daemon: Daemon, client: rtcf.Client) -> None:
    client.load(rtcf.component("rtcf_test", "Knobs", name="knobs", parameters=["rate:=2.5"]))
    client.start()
    wait_for(lambda: port_value(client, "knobs", "product") == 5.0, "2 * 2.5")
    before = iteration(client)
    done = daemon.ctl("set", "knobs", "count:=4", "rate:=0.25", "label:=four", "mode:=run")
    assert (done.returncode, done.stderr) == (0, "")
    wait_for(lambda: port_value(client, "knobs", "product") == 1.0, "4 * 0.25")
    assert port_value(client, "knobs", "length") == 4
    assert daemon.ctl("set", "knobs", "mode:=idle").returncode == 0
    wait_for(lambda: port_value(client, "knobs", "product") == 0.0, "nothing")
    # An integer is accepted for a double.
    assert daemon.ctl("set", "knobs", "mode:=run", "rate:=3", "enabled:=true").returncode == 0
    wait_for(lambda: port_value(client, "knobs", "product") == 12.0, "4 * 3")
    info = json.loads(daemon.ctl("info", "knobs", "-o", "json").stdout)
    values = {each["name"]: each["value"] for each in info["parameters"]}
    assert values == {"enabled": True, "count": 4, "rate": 3.0, "label": "four", "mode": "run"}
    assert iteration(client) > before


def test_a_replacement_keeps_parameters_that_it_does_not_set(
    daemon: Daemon, client: rtcf.Client
) -> None:
    client.load(rtcf.component("rtcf_test", "Knobs", name="knobs", parameters=["rate:=2.5"]))
    client.start()
    assert daemon.ctl("set", "knobs", "count:=4", "label:=mine").returncode == 0
    done = daemon.ctl("replace", "knobs", "rtcf_test", "Knobs", "--param", "label:=theirs")
    assert done.stdout == "replaced knobs by /knobs; kept count 4, rate 2.5\n"
    assert parameter_values(client, "knobs") == {
        "enabled": True, "count": 4, "rate": 2.5, "label": "theirs", "mode": "run",
    }  # fmt: skip
    # They are in the saved graph, too.
    saved = daemon.ctl("save").stdout
    assert "count: 4" in saved and "rate: 2.5" in saved and "label: theirs" in saved
    assert daemon.ctl("runner", "restart", "rt_runner").returncode == 0
    assert parameter_values(client, "knobs")["count"] == 4


def test_a_replacement_reports_parameters_that_do_not_fit(
    daemon: Daemon, client: rtcf.Client
) -> None:
    client.load(rtcf.component("rtcf_test", "Knobs", name="knobs", parameters=["rate:=2.5"]))
    done = daemon.ctl("replace", "knobs", "rtcf_test", "Counter")
    assert done.stdout == "replaced knobs by /knobs\n"
    # No note about the others, whose values are defaults.
    note = "parameter rate = 2.5 is not kept: rtcf_test/Counter has no such parameter"
    assert done.stderr == f"rtcfctl: note: {note}\n"


def test_a_replacement_starts_with_defaults_if_requested(
    daemon: Daemon, client: rtcf.Client
) -> None:
    client.load(rtcf.component("rtcf_test", "Knobs", name="knobs", parameters=["rate:=2.5"]))
    done = daemon.ctl("replace", "knobs", "rtcf_test", "Knobs", "--reset-parameters")
    assert (done.stdout, done.stderr) == ("replaced knobs by /knobs\n", "")
    assert parameter_values(client, "knobs")["rate"] == 1.5


def test_derived_values_change_in_the_same_cycle_as_the_frequency(client: rtcf.Client) -> None:
    client.load(rtcf.component("rtcf_test", "Sampled", name="fast"))
    client.load(rtcf.component("rtcf_test", "Sampled", name="slow", every=3,
                               remaps=["design:=/slow_design"]))  # fmt: skip
    client.start()
    for frequency in (250.0, 2000.0, 500.0):
        client.set_runner(runner_pb2.RunnerSettings(frequency_hz=frequency))
        wait_until_after(client, iteration(client) + 20)
        for name, every in (("fast", 1), ("slow", 3)):
            found = client.get_component(name)
            assert [each.value for each in found.states] == ["0"], f"{name}: another period's value"
            assert port_value(client, name, "design") == every * round(1e9 / frequency)


def test_a_frequency_that_a_component_cannot_have_is_rejected(client: rtcf.Client) -> None:
    client.load(rtcf.component("rtcf_test", "Sampled", name="other",
                               remaps=["design:=/other_design"]))  # fmt: skip
    client.load(
        rtcf.component("rtcf_test", "Sampled", name="strict", parameters=["longest:=0.002"])
    )
    client.start()
    with pytest.raises(rtcf.RefusedError, match="strict.*5000000 ns is too long a period"):
        client.set_runner(runner_pb2.RunnerSettings(frequency_hz=200.0))
    wait_until_after(client, iteration(client) + 20)
    assert client.get_status("rt_runner").runners[0].settings.frequency_hz == 1000.0
    client.set_parameters("strict", [rtcf.parse_parameter("longest:=0.005")])
    client.set_runner(runner_pb2.RunnerSettings(frequency_hz=200.0))
    wait_until_after(client, iteration(client) + 20)
    for name in ("other", "strict"):
        assert [each.value for each in client.get_component(name).states] == ["0"]


def test_a_removed_break_of_a_first_component_stays_removed(client: rtcf.Client) -> None:
    client.load(rtcf.component("rtcf_examples", "Identity", name="src", remaps=["out:=/x"]))
    reader = rtcf.component(
        "rtcf_examples", "Mimo", name="dst", remaps=["in1:=/x", "in2:=/x"], first=True
    )
    client.load(reader)
    before = client.get_component("dst")
    assert [port.broken for port in before.ports[:4]] == [True] * 4
    client.set_breaks(_ports("dst.in1"), False)
    client.restart_runner("rt_runner")
    after = client.get_component("dst")
    assert [port.broken for port in after.ports[:4]] == [False, True, True, True]
    assert (after.spec.first, list(after.spec.breaks)) == (False, ["in2", "in3", "in4"])
    specs = [client.get_component("src").spec, before.spec]
    (difference,) = client.apply(specs).differences
    assert (difference.component, difference.detail) == ("/dst", "other loop breaks")
    assert client.get_component("dst").spec.first


def test_a_removed_break_of_an_ignored_connection_stays_removed(client: rtcf.Client) -> None:
    client.load(
        rtcf.component(
            "rtcf_examples", "Mimo", name="dst", remaps=["in1:=/x", "in2:=/y"], ignore="/x|/y"
        )
    )
    client.set_breaks(_ports("dst.in1"), False)
    client.restart_runner("rt_runner")
    after = client.get_component("dst")
    assert [port.broken for port in after.ports[:4]] == [False, True, False, False]
    assert (after.spec.ignore, list(after.spec.breaks)) == ("", ["in2"])

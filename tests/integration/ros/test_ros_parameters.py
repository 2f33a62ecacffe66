"""Parameters through dynamic_reconfigure, as used by dynparam and rqt_reconfigure."""

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
import rosgraph
import rtcf
import yaml
from daemon_process import Daemon, stopped, wait_for, wait_until_it_is, with_ros
from holding_master import HoldingMaster
from launch_processes import Launching
from parameter_rule import CASES, SCALARS
from ros_processes import Master
from rtcf.v1 import runner_pb2
from values import parameter_values, port_value

_NAME = "/arm/knobs"


@pytest.fixture
def knobs(ros_daemon: tuple[Daemon, rtcf.Client], master: Master) -> tuple[Daemon, rtcf.Client]:
    """Return a daemon with a running loop of Knobs, which has a parameter of each type, on ROS."""
    _, client = ros_daemon
    client.load(rtcf.component("rtcf_test", "Knobs", name="knobs", ns="/arm"))
    client.start()
    wait_for(lambda: f"{_NAME}/set_parameters" in master.services(), "the service")
    return ros_daemon


def dynparam(master: Master, *arguments: str) -> str:
    """Run dynparam."""
    return master.run("rosrun", "dynamic_reconfigure", "dynparam", *arguments)


def values(client: rtcf.Client) -> dict[str, Any]:
    """Return the values in rtcf."""
    return parameter_values(client, _NAME)


def test_dynparam_sets_parameters_of_all_types_in_a_running_loop(
    knobs: tuple[Daemon, rtcf.Client], master: Master
) -> None:
    daemon, client = knobs
    assert _NAME in dynparam(master, "list").split()
    wait_for(lambda: port_value(client, _NAME, "product") == 3.0, "a cycle")

    change = {"count": 4, "rate": 2.5, "label": "abcdef", "enabled": True, "mode": "run"}
    dynparam(master, "set", _NAME, json.dumps(change))
    # When the call returns, all values are in effect everywhere.
    assert values(client) == change
    wait_for(lambda: port_value(client, _NAME, "product") == 10.0, "the loop to use them")
    assert port_value(client, _NAME, "length") == 6

    def shown(*names: str) -> dict[str, Any]:
        found = yaml.safe_load(dynparam(master, "get", _NAME))
        return {name: found[name] for name in names}

    assert shown(*change) == change
    # The parameter server follows, and so does the saved state.
    wait_for(lambda: master.parameter(f"{_NAME}/rate") == 2.5, "the parameter server")
    wait_for(lambda: master.parameter(f"{_NAME}/label") == "abcdef", "the parameter server")
    state = wait_for(
        lambda: [
            file
            for file in (daemon.folder / "state").rglob("*")
            if file.is_file() and "abcdef" in file.read_text()
        ],
        "the saved state",
    )
    assert state

    # The history names the caller as far as ROS identifies it, and the change can be undone.
    wait_for(lambda: client.get_history(_NAME), "the history")
    (rate,) = client.get_history(_NAME, "rate")
    assert (rate.who, rate.how, rate.value.double_value) == (
        "a ROS peer",
        "dynamic_reconfigure",
        2.5,
    )
    client.undo_parameters(_NAME)
    assert values(client)["rate"] == rate.before.double_value

    # And the other way round.
    daemon.ctl("set", _NAME, "rate:=7", "mode:=idle")
    wait_until_it_is({"rate": 7.0, "mode": "idle"}, lambda: shown("rate", "mode"), "dynparam")
    wait_for(lambda: master.parameter(f"{_NAME}/mode") == "idle", "the parameter server")
    wait_for(lambda: master.parameter(f"{_NAME}/rate") == 7.0, "the parameter server")


def test_the_description_matches_the_declaration(
    knobs: tuple[Daemon, rtcf.Client], master: Master
) -> None:
    text = master.run("rostopic", "echo", "-n1", f"{_NAME}/parameter_descriptions")
    message = yaml.safe_load(text.split("---")[0])
    (group,) = message["groups"]
    described = {each["name"]: each for each in group["parameters"]}
    assert {name: each["type"] for name, each in described.items()} == {
        "enabled": "bool", "count": "int", "rate": "double", "label": "str", "mode": "str",
    }  # fmt: skip
    assert described["label"]["description"] == "its length is an output"
    assert described["rate"]["description"] == "[m/s]"
    # rqt_reconfigure parses it as a Python literal.
    enum = yaml.safe_load(described["mode"]["edit_method"])
    assert [each["value"] for each in enum["enum"]] == ["idle", "run"]

    def of(part: str, kind: str) -> dict[str, Any]:
        return {each["name"]: each["value"] for each in message[part][kind]}

    assert (of("min", "ints")["count"], of("max", "ints")["count"]) == (0, 10)
    assert (of("min", "doubles")["rate"], of("max", "doubles")["rate"]) == (-1.0, 1000.0)
    assert of("dflt", "doubles")["rate"] == 1.5


def test_a_value_out_of_range_is_clamped_with_a_warning(
    knobs: tuple[Daemon, rtcf.Client], master: Master
) -> None:
    _, client = knobs
    client.set_runner(runner_pb2.RunnerSettings(ros=runner_pb2.RosSettings(whitelist="/arm/.*")))
    topics = {"/arm/length", "/arm/product"}
    wait_for(lambda: topics <= master.topics()[0], "the topics")
    listener = master.node("rosout", client.get_status("rt_runner").runners[0].ros.node)
    listener.wait_until_connected()
    request = "{config: {doubles: [{name: rate, value: 2.0}], ints: [{name: count, value: 11}]}}"
    answer = master.call(f"{_NAME}/set_parameters", request)
    assert {each["name"]: each["value"] for each in answer["config"]["ints"]} == {"count": 10}
    assert (values(client)["count"], values(client)["rate"]) == (10, 2.0)
    record = wait_for(
        lambda: next((each for each in listener.records() if "maximum" in each["msg"]), None),
        "the warning",
    )
    assert record["name"] == _NAME
    assert "count = 11 is above its maximum 10: it is set to 10" in record["msg"]
    # For rqt_console: its topics and its source line.
    assert record["topics"] == ["/arm/length", "/arm/product"]
    assert record["file"]
    assert record["function"]
    listener.end()


def test_a_value_out_of_range_is_rejected_if_configured(
    knobs: tuple[Daemon, rtcf.Client], master: Master
) -> None:
    daemon, client = knobs
    daemon.ctl("runner", "set", "--refuse-out-of-range")
    node = client.get_status("rt_runner").runners[0].ros.node
    listener = master.node("rosout", node)
    listener.wait_until_connected()
    before = values(client)
    master.run(
        "rosrun", "dynamic_reconfigure", "dynparam", "set", _NAME, '{"rate": 2.0, "count": 11}',
        ok=False,
    )  # fmt: skip
    assert values(client) == before
    record = wait_for(
        lambda: next((each for each in listener.records() if "rejected" in each["msg"]), None),
        "the record",
    )
    assert record["name"] == _NAME
    assert "count = 11 is above its maximum 10" in record["msg"]
    listener.end()


def test_the_loop_follows_the_parameter_server_within_its_bounds(
    knobs: tuple[Daemon, rtcf.Client], master: Master
) -> None:
    daemon, client = knobs
    node = client.get_status("rt_runner").runners[0].ros.node
    listener = master.node("rosout", node)
    listener.wait_until_connected()
    # A number that must survive the round trip unchanged.
    daemon.ctl("set", _NAME, "rate:=0.30000000000000004")
    wait_for(lambda: master.parameter(f"{_NAME}/rate") == 0.30000000000000004, "the server")

    master.run("rosparam", "set", f"{_NAME}/count", "5")
    wait_for(lambda: values(client)["count"] == 5, "the loop to follow the change")
    assert values(client)["rate"] == 0.30000000000000004

    def shown() -> tuple[Any, Any]:
        found = yaml.safe_load(dynparam(master, "get", _NAME))
        return found["count"], found["rate"]

    wait_until_it_is((5, 0.30000000000000004), shown, "dynparam")

    # Several at once; parameters of other names are ignored.
    master.run("rosparam", "set", _NAME, "{rate: 2, mode: idle, other: 1}")
    wait_for(lambda: values(client)["mode"] == "idle", "the loop to follow the change")
    wait_for(lambda: values(client)["rate"] == 2.0, "the loop to follow the change")
    wait_for(lambda: master.parameter(f"{_NAME}/count") == 5, "the discarded value to return")
    assert master.parameter(f"{_NAME}/other") == 1

    # Rejected values do not stay on the server.
    for wrong, why in (("11", "is above its maximum 10"), ("many", "count")):
        master.run("rosparam", "set", f"{_NAME}/count", wrong)
        wait_for(lambda: master.parameter(f"{_NAME}/count") == 5, "the present value")

        def told(text: str = why) -> bool:
            return any(
                "rejected" in each["msg"] and text in each["msg"] for each in listener.records()
            )

        wait_for(told, "the reason")
    assert values(client)["count"] == 5
    # A valid value next to an invalid one, which is rejected once.
    master.run("rosparam", "set", _NAME, "{count: 12, mode: run}")
    wait_for(lambda: values(client)["mode"] == "run", "the loop to follow the change")
    wait_for(lambda: master.parameter(f"{_NAME}/count") == 5, "the present value")

    def refused() -> int:
        return sum("= 12 is above" in each["msg"] for each in listener.records())

    wait_for(refused, "the reason")
    master.run("rosparam", "delete", f"{_NAME}/count")
    wait_for(lambda: master.parameter(f"{_NAME}/count") == 5, "the value to return")
    assert refused() == 1
    listener.end()


def test_values_of_other_types_follow_one_rule_in_clients_and_graph_files(
    knobs: tuple[Daemon, rtcf.Client],
) -> None:
    _, client = knobs
    for name, text, wanted in SCALARS:
        try:
            client.set_parameters(_NAME, [rtcf.parse_parameter(f"{name}:={text}")])
        except rtcf.RefusedError as error:
            assert f"parameter {name} takes " in str(error)
            assert wanted is None, text
        else:
            assert values(client)[name] == wanted, text

    def apply(parameters: str) -> None:
        graph = (
            "components: [{name: knobs, ns: /arm, package: rtcf_test, type: Knobs, "
            f"parameters: {{{parameters}}}}}]"
        )
        client.apply(rtcf.read_graphs(graph, "graph.yaml")[0].components)

    apply("")
    defaults = values(client)
    for name, text, wanted in CASES:
        try:
            apply(f"{name}: {text}")
        except rtcf.RtcfError as error:
            assert wanted is None, (text, error)
            continue
        assert values(client) == defaults | {name: wanted}, text


def test_values_of_other_types_follow_one_rule_on_the_parameter_server(
    knobs: tuple[Daemon, rtcf.Client], master: Master
) -> None:
    daemon, client = knobs
    server = rosgraph.Master("/test", master.uri)

    def follows(name: str, value: Any) -> None:
        key = f"{_NAME}/{name}"
        wait_until_it_is(value, lambda: values(client)[name], f"the loop's {name}")
        wait_until_it_is(value, lambda: master.parameter(key), f"the server's {name}")

    for name, text, wanted in CASES:
        before = values(client)[name]
        server.setParam(f"{_NAME}/{name}", yaml.safe_load(text))
        if wanted is None:
            follows(name, before)
        else:
            wait_until_it_is(wanted, lambda key=name: values(client)[key], text)  # type: ignore[misc]
            server.setParam(f"{_NAME}/{name}", before)
            follows(name, before)
    wait_for(lambda: "/arm/knobs/mode on the parameter server is a list" in daemon.log(), "a line")
    assert "/arm/knobs/label on the parameter server is a list" in daemon.log()
    # dynparam itself makes a text of each value for a text.
    for text in ("7", "7.5", "[1, 2]"):
        dynparam(master, "set", _NAME, "label", text)
        assert values(client)["label"] == text


def test_unloading_a_component_ends_its_server(
    knobs: tuple[Daemon, rtcf.Client], master: Master
) -> None:
    _, client = knobs
    client.unload([_NAME])

    def gone() -> bool:
        published, _ = master.topics()
        names = published | master.services()
        return not any(name.startswith(f"{_NAME}/") for name in names)

    wait_for(gone, "the removal of its topics and its service")


def _load(client: rtcf.Client, *parameters: str) -> None:
    client.load(
        rtcf.component("rtcf_test", "Knobs", name="knobs", ns="/arm", parameters=list(parameters))
    )


def _holds(client: rtcf.Client, master: Master, rate: float) -> None:
    """Wait until loop and parameter server have this value."""
    wait_for(
        lambda: (values(client)["rate"], master.parameter(f"{_NAME}/rate")) == (rate, rate),
        f"{rate} to hold, not {values(client)['rate']} and {master.parameter(f'{_NAME}/rate')}",
    )


@pytest.mark.parametrize(
    ("given", "there", "holds"),
    [([], None, 1.5), ([], 3.0, 3.0), (["rate:=2.5"], 3.0, 2.5), (["rate:=2.5"], None, 2.5)],
)
def test_a_load_uses_given_values_then_those_of_the_parameter_server(
    tmp_path: Path, master: Master, given: list[str], there: float | None, holds: float
) -> None:
    daemon = Daemon(tmp_path, with_ros(master.uri, ""))
    daemon.start()
    try:
        with rtcf.Client(daemon.socket) as client:
            client.set_runner(runner_pb2.RunnerSettings(frequency_hz=200.0))
            wait_for(lambda: client.get_status("rt_runner").runners[0].ros.connected, "the node")
            # Users' parameters stay on the server, also those of other tests.
            if master.parameter(_NAME) is not None:
                master.run("rosparam", "delete", _NAME)
            if there is not None:
                master.run("rosparam", "set", f"{_NAME}/rate", str(there))
            _load(client, *given)
            _holds(client, master, holds)
            # It removes its own parameters, and keeps those of others.
            client.unload([_NAME])
            wait_for(lambda: master.parameter(f"{_NAME}/rate") == there, "the earlier value")
            wait_for(lambda: master.parameter(f"{_NAME}/count") is None, "the removal")
    finally:
        daemon.end()
        if there is not None:
            master.run("rosparam", "delete", _NAME)


def test_a_new_masters_values_replace_those_of_the_loop(tmp_path: Path) -> None:
    master = Master(tmp_path)
    master.start()
    daemon = Daemon(tmp_path, with_ros(master.uri, ""))
    daemon.start()
    try:
        with rtcf.Client(daemon.socket) as client:
            client.set_runner(runner_pb2.RunnerSettings(frequency_hz=200.0))
            _load(client, "rate:=2.0", "count:=3")
            _holds(client, master, 2.0)
            master.end()
            wait_for(
                lambda: not client.get_status("rt_runner").runners[0].ros.connected, "its absence"
            )
            # A launch file sets its parameters before anything else starts.
            with stopped(client.get_status("rt_runner").runners[0].pid):
                master.start()
                master.run("rosparam", "set", f"{_NAME}/rate", "9.0")
            _holds(client, master, 9.0)
            wait_for(lambda: master.parameter(f"{_NAME}/count") == 3, "the missing events")
    finally:
        daemon.end()
        master.end()


@pytest.fixture
def waiting(tmp_path: Path) -> Iterator[tuple[rtcf.Client, Master]]:
    """Yield a client of a loop with Knobs whose master has not started yet, and that master."""
    master = Master(tmp_path)
    daemon = Daemon(tmp_path, with_ros(master.uri, ""))
    daemon.start()
    with rtcf.Client(daemon.socket) as client:
        client.set_runner(runner_pb2.RunnerSettings(frequency_hz=200.0))
        _load(client, "rate:=2.0", "count:=3")
        client.start()
        wait_for(
            lambda: "no ROS master" in client.get_status("rt_runner").runners[0].ros.problem,
            "the node to look for a master",
        )
        yield client, master
    daemon.end()


def test_the_first_masters_values_replace_those_of_the_loop(
    waiting: tuple[rtcf.Client, Master],
) -> None:
    client, master = waiting
    with stopped(client.get_status("rt_runner").runners[0].pid):
        master.start()
        master.run("rosparam", "set", f"{_NAME}/rate", "9.0")
    try:
        _holds(client, master, 9.0)
        wait_for(lambda: master.parameter(f"{_NAME}/count") == 3, "the missing events")
        assert values(client)["count"] == 3
    finally:
        master.end()


def test_a_launch_files_values_replace_those_of_the_loop(
    waiting: tuple[rtcf.Client, Master], tmp_path: Path
) -> None:
    client, master = waiting
    launching = Launching(master, tmp_path)
    file = tmp_path / "values.launch"
    file.write_text(
        f'<launch><param name="{_NAME}/rate" value="9.0"/>'
        '<node name="waits" pkg="rtcf" type="rt_launcher" args="rtcf_examples Wave"/></launch>'
    )
    try:
        # With its own master, which has the parameters before anything else starts.
        with stopped(client.get_status("rt_runner").runners[0].pid):
            launch = launching.start("/usr/bin/roslaunch", "-p", str(master.port), str(file))
            wait_for(lambda: rosgraph.is_master_online(master.uri), "the master")
            wait_for(lambda: master.parameter(f"{_NAME}/rate") == 9.0, "the launch file's values")
        _holds(client, master, 9.0)
        wait_for(lambda: master.parameter(f"{_NAME}/count") == 3, "the missing events")
        assert values(client)["count"] == 3
        launch.end()
    finally:
        launching.end()


def test_a_text_invalid_in_xml_is_not_sent_repeatedly(tmp_path: Path, master: Master) -> None:
    way = HoldingMaster(master.port)
    daemon = Daemon(tmp_path, with_ros(way.uri, ""))
    daemon.start()
    try:
        with rtcf.Client(daemon.socket) as client:
            client.set_runner(runner_pb2.RunnerSettings(frequency_hz=200.0))
            _load(client, "label:=abcd", "rate:=2.5")
            _holds(client, master, 2.5)
            wait_for(lambda: master.parameter(f"{_NAME}/label") == "abcd", "the text")
            assert way.calls(b"setParam", f"{_NAME}/label".encode()) == 1
            daemon.ctl("set", _NAME, "label:=a\x01b")
            # The other parameters continue to be updated, and this one stays unchanged.
            for rate in (4.0, 5.0, 6.0):
                daemon.ctl("set", _NAME, f"rate:={rate}")
                _holds(client, master, rate)
            assert values(client)["label"] == "a\x01b"
            assert way.calls(b"setParam", f"{_NAME}/label".encode()) == 1
    finally:
        daemon.end()
        way.close()


def test_a_text_invalid_in_xml_is_not_on_the_parameter_server(
    knobs: tuple[Daemon, rtcf.Client], master: Master
) -> None:
    daemon, client = knobs
    wait_for(lambda: master.parameter(f"{_NAME}/rate") == 1.5, "the parameter server")
    wait_for(lambda: master.parameter(f"{_NAME}/label") is not None, "the parameter server")
    before = master.parameter(f"{_NAME}/label")
    daemon.ctl("set", _NAME, "label:=a\x01b")
    wait_for(lambda: values(client)["label"] == "a\x01b", "the value")

    def ros() -> runner_pb2.RosStatus:
        found: runner_pb2.RosStatus = client.get_status("rt_runner").runners[0].ros
        return found

    wait_for(lambda: f"{_NAME}/label" in ros().problem, "the status to say so")
    assert ros().connected
    assert master.parameter(f"{_NAME}/label") == before
    # All others continue.
    daemon.ctl("set", _NAME, "rate:=4")
    wait_for(lambda: master.parameter(f"{_NAME}/rate") == 4.0, "the parameter server")

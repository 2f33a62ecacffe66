"""Components whose texts are not UTF-8: the texts arrive with replacements, and the runner remains
usable."""

import re
import signal

import pytest
import rtcf
from daemon_process import Daemon, wait_for
from rtcf.streams.numbered import Place
from rtcf.v1 import control_pb2, graph_pb2, runner_pb2
from values import state

TEXT = "Stromst\ufffdrke"


def latin1(hook: str, act: str = "log", *, optional: bool = False) -> graph_pb2.ComponentSpec:
    parameters = [f"hook:={hook}", f"act:={act}"]
    return rtcf.component(
        "rtcf_faults", "Latin1", name="bad", optional=optional, parameters=parameters
    )


def check_usable(client: rtcf.Client) -> None:
    """Make each kind of request, with a component that behaves."""
    client.load(rtcf.component("rtcf_faults", "Latin1", name="good"))
    client.set_parameters("good", [rtcf.parse_parameter("act:=fail")])
    assert "/good" in [each.full_name for each in client.list_components()]
    client.start()
    wait_for(lambda: state(client).state == runner_pb2.RUNNER_STATE_RUNNING, "the loop")
    client.stop()
    client.unload(["good"])
    assert client.get_order() == []


def messages(client: rtcf.Client) -> list[str]:
    """Return the logged texts of the component."""
    with client.watch_logs(components=["bad"], after=Place(), until_now=True) as stream:
        return [each.message for each in stream if isinstance(each, control_pb2.LogRecord)]


@pytest.mark.parametrize("act", ["fail", "throw"])
@pytest.mark.parametrize("hook", ["prepare", "configure"])
def test_a_rejected_load_has_the_text(client: rtcf.Client, hook: str, act: str) -> None:
    with pytest.raises(rtcf.RefusedError, match=rf"/bad .*{hook}\(?\)? failed: .*{TEXT}"):
        client.load(latin1(hook, act))
    assert client.get_order() == []
    check_usable(client)


@pytest.mark.parametrize("act", ["fail", "throw"])
def test_a_rejected_start_has_the_text(client: rtcf.Client, act: str) -> None:
    client.load(latin1("start", act))
    with pytest.raises(rtcf.RefusedError, match=TEXT):
        client.start()
    client.unload(["bad"])
    check_usable(client)


@pytest.mark.parametrize("hook", ["prepare", "configure", "start", "update", "stop"])
def test_a_log_record_has_the_text(client: rtcf.Client, hook: str) -> None:
    client.load(latin1(hook))
    client.start()
    wait_for(lambda: state(client).iteration > 30, "the update that logs")
    client.stop()
    wait_for(lambda: f"{TEXT} in {hook}: {TEXT}" in messages(client), "the record")
    client.unload(["bad"])
    check_usable(client)


def test_a_fault_has_the_text_also_after_a_restart_of_rtcfd(
    daemon: Daemon, client: rtcf.Client
) -> None:
    client.load(latin1("update", "throw"))
    client.start()
    wait_for(lambda: state(client).state == runner_pb2.RUNNER_STATE_FAULTED, "the fault")
    wait_for(lambda: TEXT in daemon.log(), "the log of rtcfd")
    wait_for(lambda: client.list_incidents(), "the incident")
    assert TEXT in client.list_incidents()[0].reason
    daemon.end(signal.SIGKILL)
    daemon.start()
    with rtcf.Client(daemon.socket) as later:
        wait_for(lambda: TEXT in state(later).status, "the status")
        assert re.search(rf"update\(\) threw: {TEXT}", later.get_component("bad").fault)
        later.unload(["bad"])
        check_usable(later)


def test_a_loop_continues_without_an_optional_component_that_throws(client: rtcf.Client) -> None:
    client.load(latin1("update", "throw", optional=True))
    client.start()
    wait_for(lambda: TEXT in client.get_component("bad").fault, "the fault")
    assert state(client).state == runner_pb2.RUNNER_STATE_RUNNING
    client.stop()
    client.unload(["bad"])
    check_usable(client)


def test_a_component_may_describe_itself_in_such_texts(client: rtcf.Client) -> None:
    types = client.list_types("rtcf_latin1")
    assert list(types.problems) == []
    assert [each.doc for each in types.types] == ["Misst in \ufffdC"]
    client.load(rtcf.component("rtcf_latin1", "Thermometer", name="t"))
    (found,) = client.list_components()
    assert found.ports[0].unit == found.states[0].unit == "\ufffdC"
    assert found.states[0].doc == "W\ufffdrme"
    (parameter,) = found.parameters
    assert (parameter.unit, parameter.doc) == ("\ufffd", "gew\ufffdhnlich")
    assert parameter.value.string_value == parameter.default_value.string_value == "K\ufffdche"


def test_values_and_snapshots_of_such_a_component_are_complete(client: rtcf.Client) -> None:
    client.load(rtcf.component("rtcf_latin1", "Thermometer", name="t"))
    with client.watch_ports(["/t.*"]) as stream:
        assert {each.unit for each in stream.schema.columns} == {"\ufffdC"}
        client.step(5)
        snapshot = client.take_snapshot().snapshot
        client.step(5)
    client.stop()
    client.restore_snapshot(snapshot)
    client.step(1)
    values = [each.value for each in client.get_component("t").states]
    assert values == ["6"]

"""Unknown enumerators are rejected in every request."""

import json
from collections.abc import Iterator
from typing import Any

import pytest
import rtcf
from daemon_under_test import DaemonUnderTest
from google.protobuf.descriptor import Descriptor, FieldDescriptor
from google.protobuf.message_factory import MessageFactory
from rtcf.v1 import control_pb2, runner_pb2
from rtcfd.common import enumerators
from rtcfd.common.errors import InvalidArgument

UNKNOWN: Any = 99  # not a value of any enumeration
REQUESTS = [
    method.input_type for method in control_pb2.DESCRIPTOR.services_by_name["Control"].methods
]


def enum_fields(
    message: Descriptor, above: tuple[str, ...] = ()
) -> Iterator[list[FieldDescriptor]]:
    """Yield the path to each enumerator of a message."""
    for field in message.fields:
        if field.enum_type is not None:
            yield [field]
        elif field.message_type is not None and field.message_type.full_name not in above:
            for rest in enum_fields(field.message_type, (*above, message.full_name)):
                yield [field, *rest]


def with_value(request: Descriptor, way: list[FieldDescriptor], value: int) -> Any:
    """Return a request with one value set."""
    top = message = MessageFactory().GetPrototype(request)()
    for field in way[:-1]:
        inner = getattr(message, field.name)
        if field.label == FieldDescriptor.LABEL_REPEATED:
            inner.add()  # a valid element before it
            message = inner.add()
        else:
            inner.SetInParent()
            message = inner
    last = way[-1]
    if last.label == FieldDescriptor.LABEL_REPEATED:
        getattr(message, last.name).append(value)
    else:
        setattr(message, last.name, value)
    return top


@pytest.mark.parametrize("request_type", REQUESTS, ids=lambda each: str(each.name))
def test_each_enumerator_of_a_request_is_checked(request_type: Descriptor) -> None:
    for way in enum_fields(request_type):
        with pytest.raises(InvalidArgument, match=f"{way[-1].name} {UNKNOWN} is not known"):
            enumerators.check(with_value(request_type, way, UNKNOWN))
        for known in way[-1].enum_type.values_by_number:
            enumerators.check(with_value(request_type, way, known))


def test_requests_have_enumerators() -> None:
    assert sum(len(list(enum_fields(each))) for each in REQUESTS) > 20


def test_an_unknown_setting_is_rejected_and_not_stored(
    daemon: DaemonUnderTest, client: rtcf.Client
) -> None:
    client.set_runner(runner_pb2.RunnerSettings(frequency_hz=250.0))
    before = daemon.saved()
    for change in (
        runner_pb2.RunnerSettings(realtime=UNKNOWN),
        runner_pb2.RunnerSettings(ros=runner_pb2.RosSettings(peers=UNKNOWN)),
    ):
        with pytest.raises(rtcf.RefusedError, match=" 99 is not known: choose one of ") as refused:
            client.set_runner(change)
        assert refused.value.reason == "VALUE_INVALID"
        with pytest.raises(rtcf.RefusedError, match=" 99 is not known: choose one of "):
            client.add_runner("arm", change)
    assert daemon.saved() == before
    assert [each.runner for each in client.get_status().runners] == ["rt_runner"]


@pytest.mark.parametrize(
    ("place", "what"),
    [
        (lambda state: state["settings"].update(realtime=UNKNOWN), "realtime"),
        (lambda state: state["settings"].update(ros={"peers": UNKNOWN}), "peers"),
        (
            lambda state: state.update(
                hold={"token": "t", "holder": "h", "added": False, "settings": {"on_boot": 99}}
            ),
            "on_boot",
        ),
        (
            lambda state: state.update(
                leased={"/a": {"run_id": "", "on_lost": UNKNOWN, "holder": "h"}}
            ),
            "on_lost",
        ),
    ],
)
def test_a_state_with_an_unknown_value_is_set_aside(
    stopped_daemon: DaemonUnderTest, place: Any, what: str
) -> None:
    stopped_daemon.start()
    with stopped_daemon.client() as client:
        client.set_runner(runner_pb2.RunnerSettings(frequency_hz=250.0))
    assert stopped_daemon.end() == 0
    state = stopped_daemon.saved()
    place(state)
    (stopped_daemon.state / "rt_runner.json").write_text(json.dumps(state))
    stopped_daemon.start()
    assert f"it is corrupt ({what} 99 is not known: choose one of " in stopped_daemon.log()
    with stopped_daemon.client() as client:
        assert client.get_status().runners[0].settings.realtime == runner_pb2.REALTIME_PREFERRED


@pytest.mark.parametrize("value", [-5, 0, "NaN", 1e9])
def test_a_state_with_a_number_out_of_range_disables_no_call(
    stopped_daemon: DaemonUnderTest, value: object
) -> None:
    stopped_daemon.start()
    with stopped_daemon.client() as client:
        client.set_runner(runner_pb2.RunnerSettings(priority=70))
    assert stopped_daemon.end() == 0
    state = stopped_daemon.saved()
    state["settings"]["frequencyHz"] = value
    (stopped_daemon.state / "rt_runner.json").write_text(json.dumps(state))
    stopped_daemon.start()
    assert "is set aside as rt_runner.corrupt-" in stopped_daemon.log()
    with stopped_daemon.client() as client:
        client.start()
        client.set_runner(runner_pb2.RunnerSettings(frequency_hz=500.0))
        status = client.get_status()
    assert status.runners[0].state == runner_pb2.RUNNER_STATE_RUNNING
    assert status.runners[0].settings.frequency_hz == 500.0
    assert "Hz is out of range: 0.1 to 50000 Hz" in " ".join(status.notes)

"""Tuned parameters keep their values when a graph or source is applied again."""

import pytest
import rtcf
from daemon_under_test import DaemonUnderTest
from rtcf.v1 import control_pb2, graph_pb2


def spec(*parameters: str, name: str = "pid") -> graph_pb2.ComponentSpec:
    return rtcf.component("demo", "Fine", name=name, parameters=parameters)


def number(value: graph_pb2.ParameterValue) -> float:
    """Return a number, including an int, which this peer does not convert."""
    return float(getattr(value, str(value.WhichOneof("kind"))))


def kp(client: rtcf.Client) -> float:
    return number(client.get_component("pid").parameters[0].value)


def tune(client: rtcf.Client, text: str) -> None:
    client.set_parameters("pid", [rtcf.parse_parameter(text)])


def history(client: rtcf.Client) -> list[tuple[str, float]]:
    return [(each.how, number(each.value)) for each in client.get_history("pid", "kp")]


@pytest.fixture(params=["replace", "apply"])
def how(request: pytest.FixtureRequest) -> str:
    return str(request.param)


def again(
    client: rtcf.Client, how: str, before: graph_pb2.ComponentSpec, now: graph_pb2.ComponentSpec
) -> control_pb2.ChangeResult:
    if how == "apply":
        return client.apply([now], "rt_runner", given_before=[before])
    return client.replace("pid", now, given_before=before)


@pytest.mark.parametrize("given", [(), ("kp:=1.5",), ("kp:=2",)])
def test_tuned_values_stay_and_keep_their_user(
    client: rtcf.Client, how: str, given: tuple[str, ...]
) -> None:
    client.load(spec(*given))
    tune(client, "kp:=5.0")
    before = history(client)
    for _ in range(2):
        result = again(client, how, spec(*given), spec(*given))
        assert kp(client) == 5.0
        assert history(client) == before
    if how == "replace":
        assert [each.name for each in result.kept] == ["kp"]
    else:
        assert list(result.notes) == ["/pid keeps kp = 5.0, set since"]
    client.undo_parameters("pid")
    assert kp(client) == (float(given[0].partition(":=")[2]) if given else 1.0)


def test_untuned_parameters_get_the_given_value(client: rtcf.Client, how: str) -> None:
    client.load(spec("kp:=2"))
    result = again(client, how, spec("kp:=2"), spec("kp:=2"))
    assert (kp(client), list(result.notes), len(result.kept)) == (2.0, [], 0)
    assert history(client) == [("load", 2.0)]
    again(client, how, spec("kp:=2"), spec())
    assert kp(client) == 1.0


@pytest.mark.parametrize("before", [(), ("kp:=1.5",)])
def test_a_new_given_value_applies(client: rtcf.Client, how: str, before: tuple[str, ...]) -> None:
    client.load(spec(*before))
    tune(client, "kp:=5.0")
    known = history(client)
    result = again(client, how, spec(*before), spec("kp:=3.5"))
    assert (kp(client), list(result.notes), len(result.kept)) == (3.5, [], 0)
    assert history(client) == [*known, (how, 3.5)]
    (change,) = client.get_history("pid", "kp")[-1:]
    assert change.before.double_value == 5.0


def test_an_unsuitable_tuned_value_is_reported_and_recorded(client: rtcf.Client, how: str) -> None:
    client.load(spec())
    tune(client, "kp:=-5.0")  # this peer accepts it
    result = again(client, how, spec(), spec())
    assert list(result.notes) == ["/pid: kp = -5.0 does not fit: at least 0; it is 1.0 now"]
    assert kp(client) == 1.0
    assert history(client) == [("set", -5.0), (how, 1.0)]


def test_a_value_of_another_type_does_not_fit(client: rtcf.Client, how: str) -> None:
    client.load(spec("kp:=2.5"))
    tune(client, "kp:=fast")
    result = again(client, how, spec("kp:=2.5"), spec("kp:=2.5"))
    note = "/pid: kp = fast does not fit: it is of type double now; it is 2.5 now"
    assert list(result.notes) == [note]


def test_a_new_or_different_component_has_its_given_values(
    daemon: DaemonUnderTest, client: rtcf.Client
) -> None:
    client.load(spec("kp:=2.5"))
    tune(client, "kp:=5.0")
    client.apply(
        [spec("kp:=2.5"), spec("kp:=3.5", name="other")], "rt_runner",
        given_before=[spec("kp:=3.5", name="other")],
    )  # fmt: skip
    assert kp(client) == 2.5
    (found,) = (each for each in client.list_components() if each.full_name == "/other")
    assert found.parameters[0].value.double_value == 3.5
    assert "kp: 3.5" in daemon.ctl("save").stdout


def test_tuned_values_are_in_the_saved_graph(
    daemon: DaemonUnderTest, client: rtcf.Client, how: str
) -> None:
    client.load(spec())
    tune(client, "kp:=5.0")
    again(client, how, spec(), spec())
    daemon.end()
    daemon.start()
    with daemon.client() as later:
        assert kp(later) == 5.0


def test_a_dry_run_reports_and_changes_nothing(client: rtcf.Client) -> None:
    client.load(spec())
    tune(client, "kp:=5.0")
    before = history(client)
    result = client.apply([spec()], "rt_runner", dry_run=True, given_before=[spec()])
    assert list(result.notes) == ["/pid keeps kp = 5.0, set since"]
    assert (kp(client), history(client)) == (5.0, before)

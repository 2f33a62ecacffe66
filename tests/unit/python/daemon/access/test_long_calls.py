"""Lasting calls: each message is checked, and a client that loses a right gets an error."""

from collections.abc import Iterator
from pathlib import Path
from queue import SimpleQueue

import grpc
import pytest
import rtcf
from daemon_process import DEADLINE_S, wait_for
from daemon_under_test import DaemonUnderTest
from rtcf.v1 import control_pb2
from rtcfctl.graph import component
from rtcfctl.graph.compiler import SingleCompiler
from rtcfctl.main import parser
from rtcfctl.terminal.output import Output
from strangers import open_to_strangers, root_only, stranger

WATCH = """
import sys, rtcf
from rtcf.streams.numbered import Place
with rtcf.Client(sys.argv[1]) as client:
    try:
        for number, _ in enumerate({stream}):
            if number == 0:
                print("watches", flush=True)
    except rtcf.RefusedError as refused:
        print(refused.code, refused, flush=True)
"""

HOLD = """
import sys, rtcf
from rtcf.v1 import control_pb2
with rtcf.Client(sys.argv[1]) as client:
    opening = control_pb2.OpenHold(runner="arm", token="mine", holder="test")
    hold = client.hold_runner(opening)
    try:
        for message in hold:
            if message.WhichOneof("kind") == "taken":
                print("holds", flush=True)
                sys.stdin.readline()
                hold.end()
    except rtcf.RefusedError as refused:
        print(refused.code, refused, flush=True)
"""


def rules(default: str) -> str:
    return f"[access]\ndefault = '{default}'\n"


LASTING = ["events -f", "stats --watch 0.1"]


@pytest.mark.parametrize("command", [*LASTING, "logs -f"])
def test_watching_an_unknown_runner_is_an_error(daemon: DaemonUnderTest, command: str) -> None:
    done = daemon.ctl("-r", "nobody", *command.split())
    assert done.returncode == 1
    assert done.stderr == (
        'rtcfctl: no runner "nobody" (runners: rt_runner); `rtcfctl runner add nobody` adds it\n'
    )


@pytest.mark.parametrize("command", LASTING)
def test_a_watcher_is_told_when_its_runner_is_removed(
    daemon: DaemonUnderTest, client: rtcf.Client, command: str
) -> None:
    client.add_runner("arm")
    process = daemon.ctl_process("-r", "arm", *command.split())
    try:
        assert process.stdout is not None and process.stdout.readline()
        client.remove_runner("arm")
        shown, said = process.communicate(timeout=DEADLINE_S)
    finally:
        process.kill()
        process.communicate()
    assert (process.returncode, said.count("\n")) == (1, 1)
    assert said.startswith("rtcfctl: ") and "arm" in said
    if command.startswith("events"):
        assert " arm runner_removed: runner removed" in shown.splitlines()[-1]


def test_a_source_is_watched_while_its_component_exists(
    client: rtcf.Client, tmp_path: Path
) -> None:
    source = tmp_path / "source.py"
    source.touch()
    client.load(rtcf.component("demo", "Fine", name="a"))
    args = parser().parse_args(["load", str(source), "Fine", "--watch"])

    def looks() -> Iterator[bool]:
        yield from [False] * 20
        client.unload(["a"])
        yield from [False] * 20

    with pytest.raises(rtcf.RefusedError, match="no component /a"):
        # Nothing is saved, so nothing is compiled.
        component.watch(client, args, Output("table"), "/a", looks(), SingleCompiler(""))


@root_only
@pytest.mark.parametrize(
    "stream",
    [
        # From the start on, so that one exists immediately.
        "client.watch_events(after=Place())",
        "client.watch_statistics(interval_s=0.1)",
    ],
)
def test_a_watch_ends_when_the_right_is_withdrawn(stream: str) -> None:
    program = WATCH.format(stream=stream)
    with (
        open_to_strangers(rules("observe")) as daemon,
        stranger(program, str(daemon.socket)) as watcher,
    ):
        assert watcher.stdout is not None
        assert watcher.stdout.readline() == "watches\n"
        daemon.settings.write_text(rules("none"))
        with daemon.client() as client:
            client.reload()
        said = watcher.stdout.readline()
        assert said.startswith("PERMISSION_DENIED Watch")
        assert "requires the right to observe, and user #54321 has none" in said


@root_only
def test_later_messages_require_the_right_too() -> None:
    with (
        open_to_strangers(rules("admin")) as daemon,
        stranger(HOLD, str(daemon.socket)) as holder,
    ):
        assert holder.stdout is not None and holder.stdin is not None
        assert holder.stdout.readline() == "holds\n"
        daemon.settings.write_text(rules("observe"))
        with daemon.client() as client:
            client.reload()
        print("go on", file=holder.stdin, flush=True)
        assert holder.stdout.readline().startswith(
            "PERMISSION_DENIED HoldRunner requires the right to administer, "
            "and user #54321 has only"
        )


@pytest.mark.parametrize(
    ("message", "said"),
    [
        (b"\xff", "the request of LeaseComponent is malformed"),
        (
            control_pb2.LeaseComponentRequest(
                open=control_pb2.OpenLease(component=rtcf.component("demo", "x" * 300))
            ).SerializeToString(),
            "characters",
        ),
    ],
    ids=["malformed", "too long"],
)
def test_a_rejected_second_message_ends_the_call_and_its_lease(
    daemon: DaemonUnderTest, client: rtcf.Client, message: bytes, said: str
) -> None:
    opening = control_pb2.OpenLease(
        component=rtcf.component("demo", "Fine", name="held"), run_id="run", holder="test"
    )
    requests: SimpleQueue[bytes | None] = SimpleQueue()
    requests.put(control_pb2.LeaseComponentRequest(open=opening).SerializeToString())
    with grpc.insecure_channel(f"unix:{daemon.socket}") as channel:
        lease = channel.stream_stream(
            "/rtcf.v1.Control/LeaseComponent",
            response_deserializer=control_pb2.LeaseComponentResponse.FromString,
        )
        answers = lease(iter(requests.get, None), timeout=DEADLINE_S)
        while next(answers).WhichOneof("kind") != "loaded":
            pass
        requests.put(message)
        with pytest.raises(grpc.RpcError) as refused:
            list(answers)
        requests.put(None)
    assert refused.value.code() == grpc.StatusCode.INVALID_ARGUMENT
    assert said in refused.value.details()
    wait_for(lambda: not client.list_components(), "the end of the lease")

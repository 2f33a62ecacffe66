"""The control socket: ownership, client limit, invalid input."""

import random
import signal
import socket
import subprocess
from contextlib import ExitStack
from pathlib import Path

import grpc
import pytest
import rtcf
from daemon_process import BUILD_TREE, DEADLINE_S, wait_for
from daemon_under_test import DaemonUnderTest
from rtcf.v1 import control_pb2

TIMES = [300, pytest.param(10_000, marks=pytest.mark.long)]


def test_a_socket_taken_over_by_another_daemon_is_kept(daemon: DaemonUnderTest) -> None:
    daemon.socket.unlink()
    with socket.socket(socket.AF_UNIX) as other:
        other.bind(str(daemon.socket))
        assert daemon.end() == 0
        assert daemon.socket.is_socket()


def test_a_file_at_the_sockets_path_is_rejected_and_kept(stopped_daemon: DaemonUnderTest) -> None:
    stopped_daemon.socket.write_text("mine")
    stopped_daemon.start()
    assert "is in the way and is no socket" in stopped_daemon.log()
    assert stopped_daemon.socket.read_text() == "mine"


def test_a_link_at_the_sockets_path_is_rejected_and_kept(stopped_daemon: DaemonUnderTest) -> None:
    target = stopped_daemon.folder / "target"
    with socket.socket(socket.AF_UNIX) as stale:
        stale.bind(str(target))
    stopped_daemon.socket.symlink_to(target)
    stopped_daemon.start()
    assert "is in the way and is no socket" in stopped_daemon.log()
    assert target.is_socket()


def test_a_passed_socket_is_adopted_and_kept(tmp_path: Path) -> None:
    path = tmp_path / "passed"
    with socket.socket(socket.AF_UNIX) as listener:
        listener.bind(str(path))
        listener.listen()
        # A client that connects before rtcfd starts.
        early = subprocess.Popen(
            [BUILD_TREE / "bin" / "rtcfctl", "--socket", path, "status"],
            stdout=subprocess.PIPE,
            text=True,
        )
        launcher = (
            "import os, sys\n"
            "os.dup2(int(sys.argv[1]), 3)\n"
            "os.environ |= {'LISTEN_PID': str(os.getpid()), 'LISTEN_FDS': '1'}\n"
            "os.execv(sys.argv[2], sys.argv[2:])\n"
        )
        process = subprocess.Popen(
            ["/usr/bin/python3", "-c", launcher, str(listener.fileno()),
             str(BUILD_TREE / "bin" / "rtcfd"), "--foreground", "--runtime-dir",
             str(tmp_path / "run"), "--no-default-runner"],
            pass_fds=(listener.fileno(), 3) if listener.fileno() != 3 else (3,),
            stderr=subprocess.DEVNULL,
        )  # fmt: skip
    assert early.communicate(timeout=DEADLINE_S)[0].startswith("rtcfd ")
    process.send_signal(signal.SIGTERM)
    assert process.wait(DEADLINE_S) == 0
    assert path.is_socket()


def test_a_client_beyond_the_limit_gets_an_error(stopped_daemon: DaemonUnderTest) -> None:
    config = stopped_daemon.folder / "rtcfd.toml"
    config.write_text("[limits]\nclients = 2\n")
    daemon = stopped_daemon.start("--config", str(config))
    with daemon.client() as one, daemon.client() as two, daemon.client() as three:
        one.get_status()
        two.get_status()
        with pytest.raises(rtcf.RefusedError, match="serves 2 clients already.*raise clients"):
            three.get_status()
    # Disconnected clients make room.
    with daemon.client() as four:
        wait_for(lambda: _answers(four), "an answer")


def test_every_client_beyond_the_limit_gets_an_error(stopped_daemon: DaemonUnderTest) -> None:
    config = stopped_daemon.folder / "rtcfd.toml"
    config.write_text("[limits]\nclients = 2\n")
    daemon = stopped_daemon.start("--config", str(config))
    with ExitStack() as ends:
        for _ in range(2):
            ends.enter_context(daemon.client()).get_status()
        # Also if many clients that are rejected do not end.
        for _ in range(30):
            client = ends.enter_context(daemon.client())
            with pytest.raises(rtcf.RefusedError, match="serves 2 clients already"):
                client.get_status()
        idle = ends.enter_context(socket.socket(socket.AF_UNIX))
        idle.connect(str(daemon.socket))
    with daemon.client() as four:
        wait_for(lambda: _answers(four), "an answer")
    assert daemon.process is not None
    descriptors = Path(f"/proc/{daemon.process.pid}/fd")
    wait_for(lambda: len(list(descriptors.iterdir())) < 60, "the end of all connections")
    assert "Traceback" not in daemon.log()


@pytest.mark.parametrize(
    "value", [b"\xc2\xb2", b"\xd9\xa1", b"\xb2", b"1" * 19, b"9" * 20, b"-1", b"", b"\xff"]
)
def test_odd_metadata_is_ignored(daemon: DaemonUnderTest, value: bytes) -> None:
    pairs = (
        *((b":method", b"POST"), (b":scheme", b"http"), (b":path", b"/rtcf.v1.Control/GetStatus")),
        *((b":authority", b"localhost"), (b"content-type", b"application/grpc")),
        *((b"te", b"trailers"), (b"rtcf-asked-ns", value)),
    )
    headers = b"".join(
        b"\0" + bytes([len(name)]) + name + bytes([len(text)]) + text for name, text in pairs
    )

    def frame(kind: int, flags: int, payload: bytes) -> bytes:
        head = len(payload).to_bytes(3, "big") + bytes([kind, flags, 0, 0, 0, kind < 2])
        return head + payload

    with socket.socket(socket.AF_UNIX) as client:
        client.settimeout(DEADLINE_S)
        client.connect(str(daemon.socket))
        client.sendall(
            b"PRI * HTTP/2.0\r\n\r\nSM\r\n\r\n"
            + frame(4, 0, b"") + frame(1, 4, headers) + frame(0, 1, bytes(5))
        )  # fmt: skip
        ended = (
            False  # the call, by the end of its stream; gRPC itself rejects some values by a reset
        )
        with client.makefile("rb") as answer:
            while not ended:
                head = answer.read(9)
                assert len(head) == 9
                answer.read(int.from_bytes(head[:3], "big"))
                of_call = head[8] == 1
                ended = of_call and (head[3] == 3 or bool(head[4] & 1))
    with daemon.client() as other:
        other.get_status()
    assert "Traceback" not in daemon.log()


def test_a_change_with_unknown_fields_is_rejected(daemon: DaemonUnderTest) -> None:
    with daemon.client() as client:
        client.load(rtcf.component("demo", "Fine", name="pid"))
        known = control_pb2.SetParametersRequest(
            component="pid", parameters=[rtcf.parse_parameter("kp:=2.5")]
        )
        # Field 99, for example a later `dry_run`; also inside another message.
        unknown = b"\x98\x06\x01"
        inner = known.parameters[0].SerializeToString() + unknown
        nested = b"\x1a" + bytes([len(inner)]) + inner
        assert control_pb2.SetParametersRequest.FromString(nested).parameters[0].name == "kp"
        with grpc.insecure_channel(f"unix:{daemon.socket}") as channel:
            call = channel.unary_stream("/rtcf.v1.Control/SetParameters")
            for data in (known.SerializeToString() + unknown, b"\x12\x03pid" + nested):
                with pytest.raises(grpc.RpcError) as refused:
                    list(call(data, timeout=DEADLINE_S))
                assert "fields that rtcfd" in str(refused.value.details())
            status = channel.unary_unary("/rtcf.v1.Control/GetStatus")
            status(unknown, timeout=DEADLINE_S)  # a query does nothing that it should not
        assert client.get_component("pid").parameters[0].value.double_value != 2.5
        with pytest.raises(rtcf.RefusedError, match="/pid: no parameter is given: name one"):
            client.set_parameters("pid", [])


def _answers(client: rtcf.Client) -> bool:
    try:
        client.get_status()
    except rtcf.RtcfError:
        return False
    return True


def test_a_request_that_is_too_large_is_rejected(stopped_daemon: DaemonUnderTest) -> None:
    config = stopped_daemon.folder / "rtcfd.toml"
    config.write_text("[limits]\nmessage_kb = 16\n")
    daemon = stopped_daemon.start("--config", str(config))
    with daemon.client() as client:
        with pytest.raises(rtcf.RtcfError, match="larger than rtcfd accepts.*message_kb"):
            client.load(rtcf.component("demo", "Fine", name="x" * 20_000))
        client.get_status()


def _messages() -> list[tuple[str, str]]:
    service = control_pb2.DESCRIPTOR.services_by_name["Control"]
    return [(method.name, method.input_type.name) for method in service.methods]


@pytest.mark.parametrize("times", TIMES)
def test_malformed_requests_change_nothing_and_end_nothing(
    daemon: DaemonUnderTest, times: int
) -> None:
    with daemon.client() as client:
        client.load(rtcf.component("demo", "Fine", name="kept"))
        pid = client.get_status().runners[0].pid
    noise = random.Random(times)
    names = [name for name, _ in _messages() if name not in ("Stop", "Unload", "RemoveRunner")]
    with grpc.insecure_channel(f"unix:{daemon.socket}") as channel:
        for _ in range(times):
            method = noise.choice([*names, "NoSuchMethod"])
            call = channel.unary_stream(f"/rtcf.v1.Control/{method}")
            # Never a valid message: wire type 7 does not exist.
            data = b"\x0f" + noise.randbytes(noise.randrange(64))
            with pytest.raises(grpc.RpcError) as refused:
                list(call(data, timeout=DEADLINE_S))
            assert refused.value.code().name in ("INVALID_ARGUMENT", "UNIMPLEMENTED")
    with daemon.client() as client:
        status = client.get_status().runners[0]
        assert status.pid == pid
        assert client.get_order() == ["/kept"]
    assert "Traceback" not in daemon.log()


@pytest.mark.parametrize("times", TIMES)
def test_random_bytes_on_the_socket_end_nothing(daemon: DaemonUnderTest, times: int) -> None:
    noise = random.Random(times)
    for number in range(times):
        with socket.socket(socket.AF_UNIX) as client:
            client.connect(str(daemon.socket))
            try:
                if number % 2:  # an HTTP/2 preface, then random bytes
                    client.sendall(b"PRI * HTTP/2.0\r\n\r\nSM\r\n\r\n")
                client.sendall(noise.randbytes(noise.randrange(200)))
            except OSError:
                pass  # rtcfd closed the connection
    with daemon.client() as client:
        wait_for(lambda: _answers(client), "an answer")
    assert "Traceback" not in daemon.log()
    assert daemon.process is not None
    descriptors = Path(f"/proc/{daemon.process.pid}/fd")
    wait_for(lambda: len(list(descriptors.iterdir())) < 200, "the end of all connections")

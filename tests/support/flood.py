"""An observer that uses up every resource rtcfd grants: `flood.py SOCKET STOP`.

Runs until it is killed; prints `there` when the flood has begun.
"""

import contextlib
import itertools
import socket
import sys
import threading
import time
from collections.abc import Callable, Iterator

import grpc
from rtcf.v1 import control_pb2, control_pb2_grpc

PREFACE = b"PRI * HTTP/2.0\r\n\r\nSM\r\n\r\n" + bytes([0, 0, 0, 4, 0, 0, 0, 0, 0])
PING = bytes([0, 0, 8, 6, 0, 0, 0, 0, 0]) + b"12345678"


def connected(path: str) -> socket.socket:
    """Return a connection, or an unconnected socket if rtcfd accepts no more."""
    peer = socket.socket(socket.AF_UNIX)
    peer.settimeout(0.2)
    with contextlib.suppress(OSError):
        peer.connect(path)
    return peer


def stubs(path: str) -> Iterator[control_pb2_grpc.ControlStub]:
    """Yield stubs, each with its own connection."""
    while True:
        options = (("grpc.use_local_subchannel_pool", 1), ("grpc.max_metadata_size", 1 << 20))
        channel = grpc.insecure_channel(f"unix:{path}", options=options)
        yield control_pb2_grpc.ControlStub(channel)  # type: ignore[no-untyped-call]


def again(work: Callable[[], object]) -> None:
    """Repeat `work` forever, ignoring errors."""

    def loop() -> None:
        while True:
            try:
                work()
            except (grpc.RpcError, OSError, ValueError):
                time.sleep(0.001)

    threading.Thread(target=loop, daemon=True).start()


def idle(path: str, _: str) -> None:
    """Connections without requests."""
    peers = [connected(path) for _ in range(300)]

    def exchange() -> None:
        time.sleep(0.01)
        peers.append(connected(path))
        peers.pop(0).close()

    again(exchange)


def reconnects(path: str, _: str) -> None:
    """Connections that are opened and closed."""
    again(lambda: connected(path).close())


def names(path: str, _: str) -> None:
    """Names of the maximum message size, and longer ones."""
    clients = stubs(path)
    lock = threading.Lock()
    lengths = itertools.cycle((4000, 900_000, 16_000_000))

    def ask() -> None:
        with lock:
            stub, length = next(clients), next(lengths)
        for _ in range(20):
            with contextlib.suppress(grpc.RpcError):
                stub.GetComponent(control_pb2.GetComponentRequest(component="x" * length))

    again(ask)


def watches(path: str, _: str) -> None:
    """More statistics streams than can be served."""
    clients = stubs(path)
    request = control_pb2.WatchStatisticsRequest(interval_ms=1)
    kept = [
        stub.WatchStatistics(request)
        for stub in (next(clients) for _ in range(30))
        for _ in range(50)
    ]

    def hold() -> list[object]:
        time.sleep(0.1)
        return kept

    again(hold)


def half_closed(path: str, _: str) -> None:
    """Connections that send many requests, shut down their sending side and read nothing."""
    peers = []

    def ask() -> None:
        peer = connected(path)
        peer.sendall(PREFACE + PING * 500)
        peer.shutdown(socket.SHUT_WR)
        peers.append(peer)
        if len(peers) > 200:
            peers.pop(0).close()

    again(ask)


def calls(path: str, _: str) -> None:
    """All read-only calls."""
    stub = next(stubs(path))

    def ask() -> None:
        stub.GetStatus(control_pb2.GetStatusRequest())
        stub.ListTypes(control_pb2.ListTypesRequest())
        with contextlib.suppress(grpc.RpcError):
            stub.Stop(control_pb2.StopRequest(runner="none"))
            stub.GetStatus(control_pb2.GetStatusRequest(runner="rt_runnner"))

    again(ask)


def noise(path: str, _: str) -> None:
    """Random bytes."""
    again(lambda: connected(path).sendall(PREFACE + b"\xff" * 100_000))


def stops(_: str, stop: str) -> None:
    """Random bytes to the executor's stop socket."""

    def ask() -> None:
        with connected(stop) as peer:
            with contextlib.suppress(OSError):
                peer.sendall(b"stop\n")
            peer.recv(4096)

    again(ask)


KINDS = (idle, reconnects, names, watches, half_closed, calls, noise, stops)

if __name__ == "__main__":
    for kind in KINDS:
        kind(*sys.argv[1:3])
    print("there", flush=True)
    threading.Event().wait()

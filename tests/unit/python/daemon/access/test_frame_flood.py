"""HTTP/2 frames of a user without rights: paced one by one, and no flood of them costs memory."""

import math
import random
import time
from pathlib import Path

import pytest
from daemon_under_test import DaemonUnderTest
from rtcfd.access.frame_pace import FramePace
from rtcfd.common.pace import Pace
from strangers import open_to_strangers, root_only, stranger

PREFACE = b"PRI * HTTP/2.0\r\n\r\nSM\r\n\r\n"


def frame(kind: int, payload: bytes, flags: int = 0, stream: int = 1) -> bytes:
    head = len(payload).to_bytes(3, "big") + bytes([kind, flags]) + stream.to_bytes(4, "big")
    return head + payload


class Recorded(Pace):
    """A pace that records its units, and delays frames of more than one unit."""

    def __init__(self) -> None:
        super().__init__(1.0)
        self.taken: list[float] = []

    def take(self, amount: float = 1.0) -> float:
        self.taken.append(amount)
        return amount - 1.0


def test_frames_are_found_in_chunks_of_any_size() -> None:
    seed = random.randrange(1 << 32)
    print(f"seed {seed}")
    draw = random.Random(seed)
    for _ in range(200):
        kinds = [draw.randrange(12) for _ in range(draw.randrange(1, 20))]
        frames = [frame(kind, draw.randbytes(draw.choice((0, 1, 8, 300)))) for kind in kinds]
        sent = PREFACE + b"".join(frames)
        pace = Recorded()
        cutter = FramePace(pace)
        passed = b""
        begins = [len(PREFACE) + sum(map(len, frames[:k])) for k in range(len(frames))]
        rest = sent
        while rest:
            size = draw.choice((1, 3, 9, 10, 40, 10_000))
            for part, wait_s in cutter.cut(rest[:size], paced=True):
                passed += part
                if wait_s:
                    # gRPC has a part of the frame's header at most.
                    kind = len(pace.taken) - 1
                    assert begins[kind] <= len(passed) < begins[kind] + 9
            rest = rest[size:]
        assert passed == sent
        assert pace.taken == [1.0 if kind in (0, 2, 8) else 10.0 for kind in kinds]


def test_frames_of_trusted_users_do_not_wait() -> None:
    pace = Recorded()
    cutter = FramePace(pace)
    sent = PREFACE + frame(6, b"12345678") * 100
    assert list(cutter.cut(sent, paced=False)) == [(sent, 0.0)]
    assert pace.taken == []
    # The rules have changed.
    assert [wait_s for _, wait_s in cutter.cut(frame(6, b"12345678"), paced=True)] == [9.0, 0.0]


def call(stream: int, kind: int = 1, flags: int = 4) -> bytes:
    """Return a frame of a stream."""
    return frame(kind, b"call", flags, stream)


def passed_of(cutter: FramePace, sent: bytes, size: int, *, paced: bool) -> bytes:
    passed = b""
    for begin in range(0, len(sent), size):
        for part, _ in cutter.cut(sent[begin : begin + size], paced=paced):
            passed += part
        if cutter.evades:
            break
    return passed


@pytest.mark.parametrize("size", [1, 7, 100_000])
def test_more_calls_at_a_time_than_the_limit_do_not_pass(size: int) -> None:
    few, next_one = b"".join(call(2 * k + 1) for k in range(16)), call(33)
    more_of_the_first = call(1, 0) + call(1, 1, 5)  # a message; the end of the call's request
    cutter = FramePace(Pace(1e9))
    sent = PREFACE + few + more_of_the_first
    assert passed_of(cutter, sent, size, paced=True) == sent and not cutter.evades
    passed = passed_of(cutter, next_one, size, paced=True)
    assert cutter.evades and len(passed) < len(next_one) - len(b"call")
    # gRPC skips streams of even numbers.
    cutter = FramePace(Pace(1e9))
    passed_of(cutter, PREFACE + call(0x7FFFFFFE) + few + next_one, size, paced=True)
    assert cutter.evades
    # Users with the right `operate` have no limit.
    for limit, paced in ((16, False), (math.inf, True)):
        cutter = FramePace(Pace(1e9), limit)
        sent = PREFACE + few + next_one
        assert passed_of(cutter, sent, size, paced=paced) == sent and not cutter.evades


@pytest.mark.parametrize("size", [1, 7, 100_000])
def test_calls_at_a_time_are_those_of_a_model(size: int) -> None:
    seed = random.randrange(1 << 32)
    print(f"seed {seed}")
    draw = random.Random(seed)
    cutter = FramePace(Pace(1e9))
    passed_of(cutter, PREFACE, size, paced=True)
    running: set[int] = set()

    def answer(stream: int, kind: int, flags: int) -> None:
        sent = call(stream, kind, flags)
        for begin in range(0, len(sent), size):
            cutter.answer(sent[begin : begin + size])

    for stream in range(1, 4001, 2):
        passed_of(cutter, call(stream | (draw.random() < 0.1) << 31), size, paced=True)
        running.add(stream)
        while len(running) == 16 or (running and draw.random() < 0.5):
            ended = draw.choice(sorted(running))
            answer(draw.choice(sorted(running)), draw.randrange(2), draw.choice((0, 4)))
            running.remove(ended)
            if draw.random() < 0.3:
                passed_of(cutter, call(ended, 3, 0), size, paced=True)  # RST_STREAM of the client
            else:
                answer(ended, *draw.choice(((1, 5), (0, 1), (3, 0))))
            # The client's own end of the call, later.
            late = draw.choice((b"", call(ended, 1, 5), call(ended, 0, 1)))
            passed_of(cutter, late, size, paced=True)
        assert not cutter.evades
    extra = 17 - len(running)
    for k in range(extra):
        assert not cutter.evades
        passed_of(cutter, call(5001 + 2 * k), size, paced=True)
    assert cutter.evades


WORDS = """
import socket, sys, time

def frame(kind, flags, stream, payload=b""):
    head = len(payload).to_bytes(3, "big") + bytes([kind, flags]) + stream.to_bytes(4, "big")
    return head + payload

def literal(name, value):
    return b"@" + bytes([len(name)]) + name + bytes([len(value)]) + value

PAIRS = [(b":method", b"POST"), (b":scheme", b"http"), (b":path", b"/rtcf.v1.Control/GetStatus"),
         (b":authority", b"localhost"), (b"content-type", b"application/grpc"),
         (b"te", b"trailers")]
FIRST = b"".join(literal(*pair) for pair in PAIRS)
AGAIN = bytes(0x80 | (67 - place) for place in range(6))  # indexed, as of the dynamic table
WORD = (8).to_bytes(4, "big")
START = b"PRI * HTTP/2.0\\r\\n\\r\\nSM\\r\\n\\r\\n" + frame(4, 0, 0)
"""

# Sends frames of one kind for some seconds, on a new connection after each end.
FLOOD = (
    WORDS
    + """
KINDS = {
    "reset": lambda n: frame(1, 4, n, AGAIN) + frame(3, 0, n, WORD),
    "open": lambda n: frame(1, 4, n, AGAIN),
    "hold": lambda n: frame(1, 4, n, AGAIN),  # after the acknowledgement of gRPC's limit
    "leave": lambda n: frame(1, 4, n, AGAIN) if n < 32 else b"",  # many connections
    "call": lambda n: frame(1, 4, n, AGAIN) + frame(0, 1, n, bytes(5)),
    "rst": lambda n: frame(3, 0, 1, WORD),
    "data": lambda n: frame(0, 0, 1),
    "priority": lambda n: frame(2, 0, n, bytes(5)),
    "settings": lambda n: frame(4, 0, 0, b"\\0\\4\\0\\1\\0\\0"),
    "ping": lambda n: frame(6, 0, 0, bytes(8)),
    "goaway": lambda n: frame(7, 0, 0, bytes(8)),
    "window": lambda n: frame(8, 0, 0, (1).to_bytes(4, "big")),
    "continuation": lambda n: frame(9, 0, 1, b"\\0\\1a\\1b"),
    "unknown": lambda n: frame(99, 0, 0),
}
path, kind, seconds = sys.argv[1], sys.argv[2], float(sys.argv[3])
end = time.monotonic() + seconds
while time.monotonic() < end:
    peer = socket.socket(socket.AF_UNIX)
    try:
        peer.connect(path)
        begun = 0 if kind == "continuation" else 4
        accepted = frame(4, 1, 0) if kind != "open" else b""
        peer.sendall(START + accepted + frame(1, begun, 1, FIRST))
        peer.setblocking(False)
        left, number = b"", 3
        while time.monotonic() < end:
            if not left:
                left = b"".join(KINDS[kind](number + 2 * k) for k in range(1000))
                number += 2000
            try:
                left = left[peer.send(left):]
            except BlockingIOError:
                time.sleep(0.002)
            if kind == "leave" and not left:
                break
            try:
                while True:
                    if not peer.recv(65536):
                        raise ConnectionError
            except BlockingIOError:
                pass
    except OSError:
        time.sleep(0.01)
    peer.close()
print("done", flush=True)
"""
)
# Begins calls without a message, then asks for an answer (PING).
CALLS = (
    WORDS
    + """
peer = socket.socket(socket.AF_UNIX)
peer.connect(sys.argv[1])
peer.sendall(START + frame(1, 4, 1, FIRST)
             + b"".join(frame(1, 4, 2 * k + 1, AGAIN) for k in range(1, int(sys.argv[2])))
             + frame(6, 0, 0, bytes(8)))
received = b""
try:
    while frame(6, 1, 0, bytes(8)) not in received:
        more = peer.recv(65536)
        if not more:
            raise ConnectionError
        received += more
    print("answered")
except ConnectionError:
    print("ended")
"""
)
KINDS = (
    "reset open hold leave call rst data priority settings ping goaway window continuation unknown"
).split()
MOST_KB = 10_000


def resident_kb(daemon: DaemonUnderTest) -> int:
    assert daemon.process is not None
    lines = Path(f"/proc/{daemon.process.pid}/status").read_text().splitlines()
    return next(int(line.split()[1]) for line in lines if line.startswith("VmRSS"))


@root_only
@pytest.mark.parametrize(("calls", "outcome"), [(16, "answered"), (17, "ended")])
def test_a_connection_with_more_calls_than_the_limit_ends(calls: int, outcome: str) -> None:
    with (
        open_to_strangers("[access]\ndefault = 'none'\n") as daemon,
        stranger(CALLS, str(daemon.socket), str(calls)) as client,
    ):
        assert client.stdout is not None
        assert client.stdout.read() == f"{outcome}\n"


@root_only
@pytest.mark.parametrize("seconds", [1, pytest.param(60, marks=pytest.mark.long)])
def test_no_flood_of_frames_takes_memory_or_delays_a_stop(seconds: int) -> None:
    with open_to_strangers("[access]\ndefault = 'none'\n") as daemon, daemon.client() as client:
        for kind in KINDS:
            with stranger(FLOOD, str(daemon.socket), "settings", "0.2") as first:
                first.wait(60)
            before = largest = resident_kb(daemon)
            slowest_s = 0.0
            with stranger(FLOOD, str(daemon.socket), kind, str(seconds)) as flood:
                while flood.poll() is None:
                    begin = time.monotonic()
                    client.get_status()
                    client.start()
                    client.stop()
                    slowest_s = max(slowest_s, time.monotonic() - begin)
                    largest = max(largest, resident_kb(daemon))
                    time.sleep(0.02)
                assert flood.stdout is not None
                assert flood.stdout.read() == "done\n"
            print(f"{kind}: {largest - before} kB, status, start and stop in {slowest_s:.3f} s")
            assert largest - before < MOST_KB, kind

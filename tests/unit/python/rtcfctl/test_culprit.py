"""The cause of a late cycle, from synthetic kernel traces with causes of random kind."""

from __future__ import annotations

import struct
from dataclasses import dataclass, field

import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from rtcf.kernel.culprit import (
    Enter,
    Event,
    Fault,
    Kind,
    LateCycle,
    Leave,
    Lost,
    Switch,
    Wake,
    find_culprit,
)
from rtcf.kernel.pages import Decoder, Page

LOOP, LOOP_PRIORITY = 100, 19  # kernel's scale: SCHED_FIFO 80
CPU = 1
PERIOD_NS = 1_000_000
US = 1000
names = st.text("abcdefghijklmnopqrstuvwxyz-/_:0123456789", min_size=1, max_size=15)


@dataclass
class Timeline:
    """A CPU with a loop; writes the trace of consecutive actions on it."""

    now: int = 0
    events: list[Event] = field(default_factory=list)
    current: tuple[int, str, int] = (0, "swapper/1", 120)

    def switch(
        self,
        pid: int,
        name: str,
        priority: int,
        *,
        runnable: bool,
        uninterruptible: bool = False,
    ) -> None:
        """Switch to another thread; `runnable`: the previous one remains runnable."""
        previous, name_of_previous, of_previous = self.current
        states = (previous, name_of_previous, runnable, of_previous)
        self.events.append(Switch(self.now, CPU, *states, pid, name, priority, uninterruptible))
        self.current = (pid, name, priority)

    def loop(self, *, runnable: bool = False) -> None:
        """Switch to the loop."""
        self.switch(LOOP, "rtcf-loop", LOOP_PRIORITY, runnable=runnable)

    def idle(self) -> None:
        """Switch to the idle task."""
        self.switch(0, "swapper/1", 120, runnable=False)

    def wake(self) -> None:
        """Wake the loop."""
        self.events.append(Wake(self.now, CPU, LOOP))

    def run(self, ns: int) -> None:
        """Let time pass in the present thread."""
        self.now += ns

    def interrupt(self, key: str, name: str, ns: int) -> None:
        """Run an interrupt."""
        self.events.append(Enter(self.now, CPU, key, name))
        self.now += ns
        self.events.append(Leave(self.now, CPU, key))

    def thread(self, name: str, ns: int, pid: int = 200, priority: int = 9) -> None:
        """Run a more urgent thread in place of the loop."""
        self.switch(pid, name, priority, runnable=True)
        self.now += ns
        self.loop()


noise = st.lists(
    st.one_of(
        st.tuples(st.just("interrupt"), names, st.integers(0, 3 * US)),
        st.tuples(st.just("thread"), names, st.integers(0, 3 * US)),
        st.tuples(st.just("fault"), names, st.just(0)),
        st.tuples(st.just("run"), names, st.integers(0, 30 * US)),
    ),
    max_size=5,
)


def begun() -> tuple[Timeline, int]:
    """Return the start of a cycle on an idle CPU, and its deadline."""
    line = Timeline()
    line.idle()
    line.run(PERIOD_NS)
    deadline = line.now
    line.wake()
    line.loop(runnable=True)
    return line, deadline


def disturb(line: Timeline, disturbances: list[tuple[str, str, int]]) -> None:
    """Add short interruptions of the loop."""
    for place, (kind, name, ns) in enumerate(disturbances):
        if kind == "interrupt":
            line.interrupt(f"noise {place}", f"noise {name}", ns)
        elif kind == "thread":
            line.thread(f"noise {name}", ns, 300 + place)
        elif kind == "fault":
            line.events.append(Fault(line.now, CPU))
        else:
            line.run(ns)


def culprit(line: Timeline, kind: str, name: str, ns: int) -> tuple[Kind, str]:
    """Take the CPU from the loop in a way of this kind; return the expected cause."""
    match kind:
        case "storm":
            while ns > 0:
                line.interrupt("irq 42", f"interrupt 42 ({name})", 20 * US)
                line.run(2 * US)
                ns -= 20 * US
            return Kind.INTERRUPT, f"interrupt 42 ({name})"
        case "thread":
            line.thread(name, ns, 4711, 9)
            return Kind.THREAD, f"thread {name} (pid 4711, real-time priority 90)"
        case "deadline":
            line.thread(name, ns, 4711, -1)
            return Kind.THREAD, f"thread {name} (pid 4711, SCHED_DEADLINE)"
        case "throttled":
            line.switch(0, "swapper/1", 120, runnable=True)
            line.run(ns)
            line.loop()
            return Kind.THROTTLED, "the CPU was idle"
        case "throttled beside others":
            line.switch(4711, name, 120, runnable=True)
            line.run(ns)
            line.loop(runnable=True)
            return Kind.THROTTLED, f"thread {name} (pid 4711, nice 0) ran"
        case "page in memory":
            for _ in range(ns // (3 * US) + 1):
                line.events.append(Fault(line.now, CPU))
                line.run(3 * US)
            return Kind.PAGE_FAULT, "page faults"
        case "page on disk":
            line.events.append(Fault(line.now, CPU))
            line.run(10 * US)
            line.switch(0, "swapper/1", 120, runnable=False, uninterruptible=True)
            line.run(ns)
            line.wake()
            line.loop()
            return Kind.PAGE_FAULT, "waited for its page"
        case "sleep":
            line.run(10 * US)
            line.idle()
            line.run(ns)
            line.wake()
            line.loop()
            return Kind.BLOCKED, "slept in a system call"
        case _:
            line.run(ns)  # the machine stalls
            return Kind.UNKNOWN, "nothing else ran"


KINDS = ("storm", "thread", "deadline", "throttled", "throttled beside others", "page in memory",
         "page on disk", "sleep", "gap")  # fmt: skip


def cycles_before(line: Timeline, count: int) -> None:
    """Run some cycles on time."""
    for _ in range(count):
        line.interrupt("vector", "interrupt local timer", US)
        line.wake()
        line.loop(runnable=True)
        line.run(200 * US)
        line.idle()
        line.run(PERIOD_NS - line.now % PERIOD_NS)


@given(
    kind=st.sampled_from(KINDS), name=names, late_us=st.integers(100, 5000),
    before=st.integers(0, 3), first=noise, last=noise,
)  # fmt: skip
def test_the_cause_of_a_late_cycle_is_named(
    kind: str,
    name: str,
    late_us: int,
    before: int,
    first: list[tuple[str, str, int]],
    last: list[tuple[str, str, int]],
) -> None:
    line = Timeline()
    line.idle()
    line.run(PERIOD_NS)
    cycles_before(line, before)
    deadline = line.now
    line.interrupt("vector", "interrupt local timer", US)
    line.wake()
    line.loop(runnable=True)
    begin = line.now
    disturb(line, first)
    # Late by less than the cause's duration, and by more than all other interruptions.
    found = culprit(line, kind, name, PERIOD_NS + late_us * US)
    disturb(line, last)
    late = LateCycle(deadline, begin, line.now, line.now - deadline - PERIOD_NS)
    line.idle()
    said = find_culprit(line.events, LOOP, late)
    expected, words = found
    assert said.kind is expected
    assert words in said.words


@given(st.sampled_from(("storm", "thread")), names, st.integers(10, 900))
def test_the_cause_of_a_late_start_is_named(kind: str, name: str, taken_us: int) -> None:
    """A thread that runs when the loop is woken, and finishes first."""
    line = Timeline()
    line.idle()
    line.run(PERIOD_NS)
    deadline = line.now
    line.interrupt("vector", "interrupt local timer", US)
    line.wake()
    if kind == "thread":
        line.switch(4711, name, 9, runnable=True)
        line.run(taken_us * US)
        expected = (Kind.THREAD, f"thread {name} (pid 4711, real-time priority 90)")
    else:
        line.interrupt("irq 42", f"interrupt 42 ({name})", taken_us * US)
        expected = (Kind.INTERRUPT, f"interrupt 42 ({name})")
    line.loop()
    begin = line.now
    line.run(950 * US)
    late = line.now - deadline - PERIOD_NS
    line.idle()
    if late <= 0 or late > taken_us * US:
        return
    said = find_culprit(line.events, LOOP, LateCycle(deadline, begin, line.now, late))
    assert (said.kind, said.words) == expected
    assert said.taken_ns == taken_us * US


@pytest.mark.parametrize(
    ("at_first", "at_last", "words"),
    [
        (120, 9, "thread hog (pid 4711, real-time priority 90)"),
        (9, 120, "thread hog (pid 4711, real-time priority 90)"),
        (
            120,
            120,
            "thread hog (pid 4711, nice 0), though the loop is more urgent: preemption was off, "
            "its priority was higher meanwhile, or a limit of CPU time held the loop",
        ),
    ],
)
def test_a_thread_is_named_as_at_its_last_switch(at_first: int, at_last: int, words: str) -> None:
    """It runs while the loop sleeps, and changes its name and priority."""
    line, _ = begun()
    line.idle()
    line.switch(4711, "python3", at_first, runnable=False)
    line.current = (4711, "hog", at_last)
    line.run(100 * US)
    deadline = line.now
    line.interrupt("vector", "interrupt local timer", US)
    line.wake()
    line.run(2 * PERIOD_NS)
    line.loop(runnable=True)
    begin = line.now
    line.run(10 * US)
    late = LateCycle(deadline, begin, line.now, line.now - deadline - PERIOD_NS)
    said = find_culprit(line.events, LOOP, late)
    assert (said.kind, said.words) == (Kind.THREAD, words)


@pytest.mark.parametrize("then", [0, 4712])
def test_a_loop_that_is_passed_over_was_throttled(then: int) -> None:
    """It woke while a thread ran that already had the CPU."""
    line, _ = begun()
    line.idle()
    line.switch(4711, "builder", 120, runnable=False)
    deadline = line.now
    line.interrupt("vector", "interrupt local timer", US)
    line.wake()
    line.run(PERIOD_NS)
    line.switch(then, "other" if then else "swapper/1", 120, runnable=True)
    line.run(PERIOD_NS)
    line.loop(runnable=True)
    begin = line.now
    line.run(10 * US)
    late = LateCycle(deadline, begin, line.now, line.now - deadline - PERIOD_NS)
    said = find_culprit(line.events, LOOP, late)
    assert said.kind is Kind.THROTTLED
    assert "a limit of CPU time" in said.words


def test_the_duration_of_page_faults_is_measured() -> None:
    line, deadline = begun()
    begin = line.now
    for _ in range(100):
        line.events.append(Fault(line.now, CPU))
        line.run(30 * US)
    late = LateCycle(deadline, begin, line.now, line.now - deadline - PERIOD_NS)
    assert find_culprit(line.events, LOOP, late).kind is Kind.UNKNOWN
    assert find_culprit(line.events, LOOP, late, 30 * US).kind is Kind.PAGE_FAULT


@given(st.integers(1, 3), names)
def test_a_late_timer_is_an_unknown_cause(threads: int, name: str) -> None:
    """Less urgent threads keep running, and are not the cause."""
    line = Timeline()
    line.idle()
    line.run(PERIOD_NS)
    deadline = line.now
    for number in range(threads):
        line.switch(400 + number, name, 120, runnable=True)
        line.run(500 * US)
    line.interrupt("vector", "interrupt local timer", US)
    line.wake()
    line.loop(runnable=True)
    begin = line.now
    line.run(PERIOD_NS - 10 * US)
    late = line.now - deadline - PERIOD_NS
    said = find_culprit(line.events, LOOP, LateCycle(deadline, begin, line.now, late))
    assert said.kind is Kind.UNKNOWN
    assert "the timer came late" in said.words


def test_a_cycle_delayed_by_the_previous_one_names_that() -> None:
    line = Timeline()
    line.idle()
    line.wake()
    line.loop(runnable=True)
    line.run(3 * PERIOD_NS)
    end = line.now + 100 * US
    said = find_culprit(
        [*line.events,
         Switch(end, CPU, LOOP, "rtcf-loop", False, LOOP_PRIORITY, 0, "swapper/1", 120)],
        LOOP, LateCycle(PERIOD_NS, 3 * PERIOD_NS, end, end - 2 * PERIOD_NS),
    )  # fmt: skip
    assert said.kind is Kind.PREVIOUS_CYCLE
    assert said.taken_ns == 2 * PERIOD_NS


def test_many_threads_of_one_name_are_named_together() -> None:
    line, deadline = begun()
    for pid in range(200, 210):
        line.thread("stress-ng-cpu", 150 * US, pid)
    line.run(10 * US)
    late = LateCycle(deadline, deadline, line.now, line.now - deadline - PERIOD_NS)
    said = find_culprit(line.events, LOOP, late)
    assert (said.kind, said.words) == (Kind.THREAD, "threads stress-ng-cpu")


@given(
    st.lists(
        st.one_of(
            st.builds(Switch, st.integers(0, 3000), st.integers(0, 1),
                      st.sampled_from([0, 1, LOOP]), names, st.booleans(), st.integers(-1, 139),
                      st.sampled_from([0, 1, LOOP]), names,
                      st.integers(-1, 139), st.booleans()),
            st.builds(Wake, st.integers(0, 3000), st.integers(0, 1), st.sampled_from([1, LOOP])),
            st.builds(Enter, st.integers(0, 3000), st.integers(0, 1), names, names),
            st.builds(Leave, st.integers(0, 3000), st.integers(0, 1), names),
            st.builds(Fault, st.integers(0, 3000), st.integers(0, 1)),
            st.builds(Lost, st.integers(0, 3000), st.integers(0, 1)),
        ),
        max_size=20,
    ),
    st.integers(0, 1000), st.integers(0, 1000), st.integers(0, 1000), st.integers(1, 2000),
)  # fmt: skip
@example([], 0, 0, 1, 1)
def test_no_cause_is_longer_than_its_cycle(
    events: list[Event], deadline: int, latency: int, duration: int, late_ns: int
) -> None:
    events = sorted(events, key=lambda each: each.time_ns)
    cycle = LateCycle(deadline, deadline + latency, deadline + latency + duration, late_ns)
    said = find_culprit(events, LOOP, cycle)
    assert said.taken_ns <= cycle.delay_ns
    assert said.kind is Kind.UNKNOWN or said.taken_ns >= late_ns


@given(st.integers(0, 2), st.integers(0, 2))
def test_no_cause_is_named_where_events_are_lost(before: int, behind: int) -> None:
    line, deadline = begun()
    for _ in range(before):
        line.thread("other", 100 * US)
    line.events.append(Lost(line.now, CPU))
    line.run(2 * PERIOD_NS)
    for _ in range(behind):
        line.thread("other", 100 * US)
    late = LateCycle(deadline, deadline, line.now, line.now - deadline - PERIOD_NS)
    said = find_culprit(line.events, LOOP, late)
    assert said.kind is Kind.UNKNOWN


FORMATS = {
    "sched_switch": """name: sched_switch
ID: 372
format:
	field:unsigned short common_type;	offset:0;	size:2;	signed:0;
	field:int common_pid;	offset:4;	size:4;	signed:1;

	field:char prev_comm[16];	offset:8;	size:16;	signed:0;
	field:pid_t prev_pid;	offset:24;	size:4;	signed:1;
	field:int prev_prio;	offset:28;	size:4;	signed:1;
	field:long prev_state;	offset:32;	size:8;	signed:1;
	field:char next_comm[16];	offset:40;	size:16;	signed:0;
	field:pid_t next_pid;	offset:56;	size:4;	signed:1;
	field:int next_prio;	offset:60;	size:4;	signed:1;
""",
    "irq_handler_entry": """name: irq_handler_entry
ID: 225
format:
	field:int irq;	offset:8;	size:4;	signed:1;
	field:__data_loc char[] name;	offset:12;	size:4;	signed:0;
""",
}
HEADER = """	field: u64 timestamp;	offset:0;	size:8;	signed:0;
	field: local_t commit;	offset:8;	size:8;	signed:1;
	field: char data;	offset:16;	size:4080;	signed:0;
"""


def entry(delta: int, data: bytes) -> bytes:
    """Return an entry of a page in the kernel's format."""
    data += bytes(-len(data) % 4)
    if len(data) // 4 <= 28:
        return struct.pack("<I", len(data) // 4 | delta << 5) + data
    return struct.pack("<II", delta << 5, len(data) + 4) + data


def page(begin: int, entries: bytes, flags: int = 0) -> Page:
    """Return a page of CPU 3."""
    return Page(3, struct.pack("<QQ", begin, len(entries) | flags) + entries)


def test_pages_of_the_kernel_are_read() -> None:
    switched = struct.pack(
        "<HHi16siiq16sii", 372, 0, 7, b"rtcf-loop", 100, 19, 0x100, b"kworker/3:1", 55, -1
    )
    long_name = b"a-driver-whose-name-is-longer-than-what-a-short-entry-holds" * 2
    interrupted = struct.pack("<HHiiI", 225, 0, 7, 42, 16 | (len(long_name) + 1) << 16)
    other = struct.pack("<HHi", 9, 0, 7)
    extended = struct.pack("<II", 30 | 5 << 5, 2)
    stamp = struct.pack("<II", 31 | 1 << 5, 1 << 10)
    discarded = struct.pack("<III", 29 | 4 << 5, 8, 0)
    entries = (
        entry(10, switched) + extended + entry(0, other) + discarded
        + entry(1, interrupted + long_name + b"\0") + stamp + entry(2, switched)
    )  # fmt: skip
    decoder = Decoder(FORMATS, HEADER)
    first, second, third = decoder.events(page(1000, entries))
    assert first == Switch(1010, 3, 100, "rtcf-loop", True, 19, 55, "kworker/3:1", -1)
    at = 1010 + (2 << 27) + 5 + 4 + 1
    assert second == Enter(at, 3, "irq 42", f"interrupt 42 ({long_name.decode()})")
    assert third.time_ns == (1 << 37) + 1 + 2
    lost, *_ = decoder.events(page(1000, entries, 1 << 31))
    assert lost == Lost(1000, 3)


def test_another_format_is_rejected() -> None:
    with pytest.raises(ValueError, match="has no ID"):
        Decoder({"sched_switch": "nothing"}, HEADER)
    with pytest.raises(KeyError):
        Decoder(FORMATS, "nothing")

"""The culprit of a late cycle, by the kernel's trace.

A pure function of events.  It assigns each nanosecond from a cycle's deadline to its end to the
owner of the CPU.  A cause is named only if the cycle would have been on time without it; otherwise
the cause is unknown.
"""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from enum import Enum
from typing import NamedTuple

_IDLE = 0  # pid of the idle thread
_FIRST_FAIR_PRIORITY = 100  # kernel priority; smaller ones are real-time
FAULT_NS = 5_000  # maximum time of a page fault whose page is in memory
_FAULT_TO_WAIT_NS = 200_000  # maximum time from a page fault to the wait for its page


@dataclass(frozen=True)
class Switch:
    """A CPU switches from one thread to another (sched_switch)."""

    time_ns: int
    cpu: int
    previous: int  # pid
    previous_name: str
    runnable: bool  # the previous thread was preempted
    previous_priority: int  # kernel priority: 0 to 99 are real-time, 0 is the highest
    next: int  # pid
    next_name: str
    next_priority: int
    uninterruptible: bool = False  # the previous thread waits uninterruptibly in the kernel


@dataclass(frozen=True)
class Wake:
    """A thread is woken (sched_waking)."""

    time_ns: int
    cpu: int  # the CPU that wakes it
    thread: int  # pid of the woken thread


@dataclass(frozen=True)
class Enter:
    """A CPU begins an interrupt or a softirq."""

    time_ns: int
    cpu: int
    key: str  # matches Leave.key
    name: str  # for the user


@dataclass(frozen=True)
class Leave:
    """A CPU ends the innermost interrupt or softirq with this key."""

    time_ns: int
    cpu: int
    key: str


@dataclass(frozen=True)
class Fault:
    """The thread on a CPU accesses a missing page (page_fault_user and page_fault_kernel)."""

    time_ns: int
    cpu: int


@dataclass(frozen=True)
class Lost:
    """Events of a CPU are missing between the previous event and this one."""

    time_ns: int
    cpu: int


Event = Switch | Wake | Enter | Leave | Fault | Lost


@dataclass(frozen=True)
class LateCycle:
    """A cycle that ended after the next deadline; times are on the clock of the events."""

    deadline_ns: int
    begin_ns: int
    end_ns: int
    late_ns: int

    @property
    def delay_ns(self) -> int:
        """The time from the deadline to the end."""
        return self.end_ns - self.deadline_ns


class Kind(Enum):
    """The kinds of causes."""

    THREAD = "thread"
    INTERRUPT = "interrupt"
    THROTTLED = "throttled"
    PAGE_FAULT = "page fault"
    BLOCKED = "blocked"
    PREVIOUS_CYCLE = "previous cycle"
    UNKNOWN = "unknown"


@dataclass(frozen=True)
class Culprit:
    """The cause of a late cycle, and its time on the CPU."""

    kind: Kind
    words: str
    taken_ns: int = 0

    def __str__(self) -> str:
        """Return the cause and its time for the user."""
        taken = f" for {self.taken_ns / 1000:.0f} µs" if self.taken_ns else ""
        return f"{self.words}{taken}"


class _Cause(NamedTuple):
    kind: Kind
    words: str
    group: str = ""  # for the user: the group of threads with the same name


_LESS_URGENT = (
    "though the loop is more urgent: preemption was off, its priority was higher meanwhile, or a "
    "limit of CPU time held the loop"
)
_OWN = _Cause(Kind.UNKNOWN, "")  # the loop's thread runs in the cycle
_NOTHING_ELSE = _Cause(
    Kind.UNKNOWN,
    "unknown: nothing else ran: a component took long, or the machine stood still "
    "(SMI, hypervisor)",
)
_LATE_TIMER = _Cause(
    Kind.UNKNOWN,
    "unknown: the timer came late (interrupts off, idle state, SMI or hypervisor)",
)
_LOST = _Cause(Kind.UNKNOWN, "unknown: the kernel's trace has a gap there")
_SEVERAL = _Cause(Kind.UNKNOWN, "unknown: several causes, none of which is enough by itself")
_PREVIOUS = _Cause(Kind.PREVIOUS_CYCLE, "the cycle before, which ended late")
_FAULTS = _Cause(Kind.PAGE_FAULT, "page faults of the loop's thread")
_WAITED = _Cause(Kind.PAGE_FAULT, "a page fault of the loop's thread, which waited for its page")
_BLOCKED = _Cause(Kind.BLOCKED, "a component slept in a system call")


def find_culprit(
    events: Iterable[Event], thread: int, cycle: LateCycle, fault_ns: int = FAULT_NS
) -> Culprit:
    """Return the cause of a late cycle.

    thread    pid of the loop's thread
    events    in order of time, at least those of the loop's CPU; the first one is a Switch before
              the deadline, which names the running thread
    fault_ns  maximum time of a page fault whose page is in memory
    """
    taken = _shares(list(events), thread, cycle, fault_ns)
    lost = taken.pop(_LOST, 0)
    taken.pop(_OWN, 0)
    if lost:
        return _culprit(_LOST)
    if not taken:
        return _culprit(_NOTHING_ELSE)
    for causes in (taken, _grouped(taken)):
        cause, most_ns = max(causes.items(), key=lambda each: (each[1], each[0].words))
        if most_ns >= cycle.late_ns:
            return _culprit(cause, 0 if cause.kind is Kind.UNKNOWN else most_ns)
    return _culprit(_SEVERAL if sum(taken.values()) >= cycle.late_ns else _NOTHING_ELSE)


def _culprit(cause: _Cause, taken_ns: int = 0) -> Culprit:
    return Culprit(cause.kind, cause.words, taken_ns)


def _grouped(taken: dict[_Cause, int]) -> dict[_Cause, int]:
    """Return the times with all threads of the same name as one cause."""
    groups: dict[_Cause, int] = {}
    for cause, ns in taken.items():
        _add(groups, _Cause(cause.kind, cause.group) if cause.group else cause, ns)
    return groups


def _shares(events: list[Event], thread: int, cycle: LateCycle, fault_ns: int) -> dict[_Cause, int]:
    """Return the time of each cause on the CPU between deadline and end; ns."""
    cpu = _cpu_of(events, thread, cycle)
    taken: dict[_Cause, int] = {}
    switches = [each for each in events if isinstance(each, Switch) and each.cpu == cpu]
    state = _State(thread, fault_ns, iter(switches[1:]))
    now = cycle.deadline_ns
    seen = False
    for event in events:
        if event.cpu != cpu and not isinstance(event, Wake):
            continue
        if event.time_ns >= cycle.end_ns:
            break
        if event.time_ns > now:
            state.add(taken, now, event.time_ns, cycle)
            now = event.time_ns
        state.take(event)
        seen = True
    if seen:
        state.add(taken, now, cycle.end_ns, cycle)
    else:
        taken[_LOST] = cycle.delay_ns
    return {cause: ns for cause, ns in taken.items() if ns}


def _cpu_of(events: list[Event], thread: int, cycle: LateCycle) -> int | None:
    """Return the CPU on which the thread ran, and waited to run, in a cycle."""
    found: int | None = None
    for event in events:
        if isinstance(event, Switch) and thread in (event.previous, event.next):
            if event.time_ns >= cycle.end_ns and found is not None:
                break
            found = event.cpu
    return found


@dataclass
class _State:
    """The state of a CPU and of the loop's thread."""

    thread: int
    fault_limit_ns: int
    later: Iterator[Switch]  # the switches of the CPU after the next one
    current: int | None = None  # pid of the running thread; None: unknown yet
    name: str = ""  # of the running thread
    priority: int = 0  # of the running thread when it got the CPU
    last_priority: int = 0  # of the running thread when it left the CPU
    passed_over: bool = False  # the next thread has a lower priority than the loop's
    own_priority: int | None = None  # of the loop's thread
    nested: list[Enter] = field(default_factory=list)  # interrupts, the innermost last
    runnable: bool = False  # the loop's thread waits for the CPU
    throttled: bool = False  # the scheduler preferred others to the runnable loop's thread
    asleep: bool = False  # the loop's thread went to sleep and has not run since
    woke_ns: int = 0  # when the loop's thread began to run after a sleep
    fault_ns: int | None = None  # the last page fault since the loop's thread got the CPU
    waits_for_page: bool = False

    def take(self, event: Event) -> None:
        match event:
            case Switch():
                self._switch(event)
            case Wake(thread=woken) if woken == self.thread:
                self.runnable = self.current != self.thread
            case Enter():
                self.nested.append(event)
            case Leave(key=key) if any(each.key == key for each in self.nested):
                while self.nested.pop().key != key:
                    pass  # the end of an inner interrupt is missing
            case Fault(time_ns=time_ns) if self.current == self.thread:
                self.fault_ns = time_ns
            case Lost():
                self.current = None
                self.nested.clear()

    def _switch(self, event: Switch) -> None:
        self.nested.clear()  # no switch happens inside an interrupt
        if event.previous == self.thread:
            self.own_priority = event.previous_priority
            self.runnable = event.runnable
            self.asleep = not event.runnable
            self.waits_for_page = (
                event.uninterruptible
                and self.fault_ns is not None
                and event.time_ns - self.fault_ns <= _FAULT_TO_WAIT_NS
            )
        self.current, self.name = event.next, event.next_name
        self.priority = self.last_priority = event.next_priority
        self.passed_over = False
        back = next(self.later, None)
        if back is not None and back.previous == event.next:
            # The thread may have changed its name and priority meanwhile.
            self.name, self.last_priority = back.previous_name, back.previous_priority
            self.passed_over = self._is_below(back.next_priority) and back.next != self.thread
        if event.next == self.thread:
            self.own_priority = event.next_priority
            self.runnable = self.throttled = False
            if self.asleep:
                self.woke_ns = event.time_ns
            self.asleep = False
            self.fault_ns = None
        elif self.runnable and self._is_less_urgent():
            self.throttled = True

    def _is_less_urgent(self) -> bool:
        """Return whether the scheduler should prefer the loop's thread to the running one."""
        return self.current == _IDLE or self._is_below(self.priority)

    def _is_below(self, priority: int) -> bool:
        """Return whether a priority is below the loop's real-time priority.

        False if the loop is not real-time: fair threads share the CPU at any nice value.
        """
        own = self.own_priority
        return own is not None and own < _FIRST_FAIR_PRIORITY and priority > own

    def add(self, taken: dict[_Cause, int], begin: int, end: int, cycle: LateCycle) -> None:
        """Add an interval without events to its cause in `taken`."""
        for at, until in ((begin, min(end, cycle.begin_ns)), (max(begin, cycle.begin_ns), end)):
            if at >= until:
                continue
            own_fault = self.current == self.thread and not self.nested and self.fault_ns
            if own_fault and at >= cycle.begin_ns:
                # The trace has no event for the end of a page fault.
                done = max(at, min(until, own_fault + self.fault_limit_ns))
                _add(taken, _FAULTS, done - at)
                _add(taken, _OWN, until - done)
            else:
                _add(taken, self._cause(at < cycle.begin_ns, cycle), until - at)

    def _cause(self, before_begin: bool, cycle: LateCycle) -> _Cause:
        if self.current is None:
            return _LOST
        if self.nested:
            return _Cause(Kind.INTERRUPT, self.nested[-1].name)
        if self.current == self.thread:
            return _PREVIOUS if before_begin and self.woke_ns < cycle.deadline_ns else _OWN
        is_less_urgent = self._is_below(self.priority) and self._is_below(self.last_priority)
        if self.throttled or (self.runnable and is_less_urgent and self.passed_over):
            limit = "a limit of CPU time (cgroup, sched_rt_runtime_us or fair server)"
            who = "the CPU was idle" if self.current == _IDLE else f"{self._who()} ran"
            return _Cause(Kind.THROTTLED, f"{limit}: {who}", f"{limit}: others ran")
        if self.runnable and self.current != _IDLE:
            doubt = f", {_LESS_URGENT}" if is_less_urgent else ""
            return _Cause(Kind.THREAD, self._who() + doubt, f"threads {self.name}{doubt}")
        if self.runnable or before_begin:
            return _LATE_TIMER
        return _WAITED if self.waits_for_page else _BLOCKED

    def _who(self) -> str:
        explains = not self._is_below(self.priority) or self._is_below(self.last_priority)
        priority = _in_words(self.priority if explains else self.last_priority)
        return f"thread {self.name} (pid {self.current}, {priority})"


def _in_words(priority: int) -> str:
    """Return a kernel priority for the user."""
    if priority >= _FIRST_FAIR_PRIORITY:
        return f"nice {priority - 120}"
    if priority >= 0:
        return f"real-time priority {_FIRST_FAIR_PRIORITY - 1 - priority}"
    return "SCHED_DEADLINE"


def _add(taken: dict[_Cause, int], cause: _Cause, ns: int) -> None:
    taken[cause] = taken.get(cause, 0) + ns

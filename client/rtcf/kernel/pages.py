"""Decoding of the kernel's trace pages, as read from `trace_pipe_raw`.

include/linux/ring_buffer.h of the kernel defines the layout of a page and its entries; the file
`format` of an event defines the layout of the event.
"""

import re
import struct
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any

from rtcf.kernel.culprit import Enter, Event, Fault, Leave, Lost, Switch, Wake

_FIELD = re.compile(
    r"\tfield:(?P<declared>[^;]+);\toffset:(?P<offset>\d+);\tsize:(?P<size>\d+);"
    r"(?:\tsigned:(?P<signed>\d);)?"
)
_PADDING, _EXTENDED, _STAMP = 29, 30, 31  # kinds of entries other than data
_DELTA_BITS = 27
_MISSED = 1 << 31  # flag of a page: events before it are lost
_LENGTH = (1 << 20) - 1
# States of a thread: running, preempted (TASK_REPORT_MAX), and in an uninterruptible wait.
_RUNNING, _PREEMPTED, _UNINTERRUPTIBLE = 0, 0x100, 2
_SOFTIRQS = ("HI", "TIMER", "NET_TX", "NET_RX", "BLOCK", "IRQ_POLL", "TASKLET", "SCHED",
             "HRTIMER", "RCU")  # fmt: skip


@dataclass(frozen=True)
class Page:
    """A page of events of one CPU, in the kernel's format."""

    cpu: int
    data: bytes

    @property
    def begin_ns(self) -> int:
        """The time of the first event, or slightly earlier."""
        return int.from_bytes(self.data[:8], "little")


class Format:
    """The fields of one kind of event."""

    def __init__(self, text: str) -> None:
        """Parse the text of a file `format`; raises ValueError."""
        found = re.search(r"^ID: (\d+)$", text, re.M)
        if found is None:
            raise ValueError("an event format has no ID")
        self.id = int(found[1])
        self._fields: dict[str, tuple[int, int, bool, bool]] = {}
        for each in _FIELD.finditer(text):
            name = re.sub(r"\[.*", "", each["declared"].split()[-1])
            is_text = "char" in each["declared"] and "[" in each["declared"]
            signed = each["signed"] == "1"
            self._fields[name] = (int(each["offset"]), int(each["size"]), signed, is_text)

    def get(self, data: bytes, name: str) -> Any:
        """Return the value of a field, a number or text; raises KeyError."""
        offset, size, signed, is_text = self._fields[name]
        if not is_text:
            return int.from_bytes(data[offset : offset + size], "little", signed=signed)
        if size == 4:  # __data_loc: offset and length of the text
            place = int.from_bytes(data[offset : offset + size], "little")
            offset, size = place & 0xFFFF, place >> 16
        return data[offset : offset + size].split(b"\0")[0].decode(errors="replace")


Convert = Callable[[int, int, bytes], Event]


class Decoder:
    """Decodes pages into events."""

    def __init__(self, formats: dict[str, str], header_page: str) -> None:
        """Parse the texts of the files `format`, by event, and of the file `header_page`.

        Raises ValueError or KeyError if the kernel's formats are not as expected.
        """
        self._convert: dict[int, Convert] = {}
        for name, text in formats.items():
            described = Format(text)
            self._convert[described.id] = _converter(name, described)
        sizes = {each["declared"].split()[-1]: int(each["size"])
                 for each in _FIELD.finditer(header_page)}  # fmt: skip
        self._data_at = 8 + sizes["commit"]

    def events(self, page: Page) -> Iterator[Event]:
        """Yield the events of a page, in order of time."""
        if _commit(page) & _MISSED:
            yield Lost(page.begin_ns, page.cpu)
        for now, data in self._entries(page):
            convert = self._convert.get(_number(data))
            if convert is not None:
                yield convert(now, page.cpu, data)

    def entries(self, page: Page, number: int) -> Iterator[bytes]:
        """Yield the bytes of all events with the ID `number`."""
        return (data for _, data in self._entries(page) if _number(data) == number)

    def _entries(self, page: Page) -> Iterator[tuple[int, bytes]]:
        """Yield time and bytes of each event."""
        data = page.data
        now, at = page.begin_ns, self._data_at
        end = min(self._data_at + (_commit(page) & _LENGTH), len(data))
        while at + 4 <= end:
            (word,) = struct.unpack_from("<I", data, at)
            kind, delta = word & 0x1F, word >> 5
            more = struct.unpack_from("<I", data, at + 4)[0] if at + 8 <= end else 0
            if kind == _PADDING and delta == 0:
                return
            if kind == _PADDING:
                now += delta
                at += 4 + more
            elif kind == _EXTENDED:
                now += (more << _DELTA_BITS) + delta
                at += 8
            elif kind == _STAMP:
                # The upper bits are those of the previous time.
                now = (now & ~((1 << 59) - 1)) | (more << _DELTA_BITS) + delta
                at += 8
            else:
                now += delta
                begin, length = (at + 4, kind * 4) if kind else (at + 8, more - 4)
                yield now, data[begin : begin + length]
                at = begin + length


def _commit(page: Page) -> int:
    return int.from_bytes(page.data[8:12], "little")


def _number(data: bytes) -> int:
    return int.from_bytes(data[:2], "little")


def _converter(name: str, described: Format) -> Convert:
    get = described.get
    match name:
        case "sched_switch":

            def switch(now: int, cpu: int, data: bytes) -> Event:
                state = get(data, "prev_state")
                return Switch(
                    now, cpu, get(data, "prev_pid"), get(data, "prev_comm"),
                    state == _RUNNING or bool(state & _PREEMPTED), get(data, "prev_prio"),
                    get(data, "next_pid"), get(data, "next_comm"), get(data, "next_prio"),
                    bool(state & _UNINTERRUPTIBLE),
                )  # fmt: skip

            return switch
        case "sched_waking":
            return lambda now, cpu, data: Wake(now, cpu, get(data, "pid"))
        case "page_fault_user" | "page_fault_kernel":
            return lambda now, cpu, _: Fault(now, cpu)
        case "irq_handler_entry":
            return lambda now, cpu, data: Enter(
                now,
                cpu,
                f"irq {get(data, 'irq')}",
                f"interrupt {get(data, 'irq')} ({get(data, 'name')})",
            )
        case "irq_handler_exit":
            return lambda now, cpu, data: Leave(now, cpu, f"irq {get(data, 'irq')}")
        case "softirq_entry":

            def enter(now: int, cpu: int, data: bytes) -> Event:
                words = _softirq(get(data, "vec"))
                return Enter(now, cpu, words, words)

            return enter
        case "softirq_exit":
            return lambda now, cpu, data: Leave(now, cpu, _softirq(get(data, "vec")))
    vector, _, edge = name.rpartition("_")
    words = f"interrupt {vector.replace('_', ' ')}"
    if edge == "entry":
        return lambda now, cpu, _: Enter(now, cpu, words, words)
    if edge == "exit":
        return lambda now, cpu, _: Leave(now, cpu, words)
    raise ValueError(f"unknown event {name}")


def _softirq(number: int) -> str:
    return f"softirq {_SOFTIRQS[number] if number < len(_SOFTIRQS) else number}"

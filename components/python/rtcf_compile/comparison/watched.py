"""Runs the comparison in a child process, which ends even if compiled code does not.

A timer signal interrupts Python code but not compiled code. There, another timer, or a crash, kills
the child. It notes its next step in shared memory, from which the parent makes the message.
"""

import mmap
import os
import pickle
import signal
import time
import traceback
import warnings
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any, BinaryIO

import numpy as np
from rtcf.component import Component
from rtcf.component.declaration import own_field

from rtcf_compile.comparison.verify import Comparison, compare
from rtcf_compile.machine_code.compiled import Compiled
from rtcf_compile.source.mistake import Mistake
from rtcf_compile.source.processor_time import HOOK_S, enclosing_loop, limited

_LEAST_CYCLES = 50
_HEADER = 4096  # bytes before the record
_COMPONENT, _HOOK, _CYCLE, _COMPILED = range(4)


@dataclass(frozen=True)
class Amount:
    """The length of a comparison: cycles per component, or total seconds of processor time."""

    cycles: int = 0
    seconds: float = 0.0

    @classmethod
    def parse(cls, text: str) -> "Amount":
        """Parse `10000` or `1s`."""
        return cls(seconds=float(text[:-1])) if text.endswith("s") else cls(cycles=int(text))

    def enough(self, components: int) -> Callable[[int], bool]:
        """Return a function that tells whether a number of cycles is enough for a component.

        `components`: the number of components that share the time. The time of this one begins now.
        """
        if self.cycles:
            return lambda done: done >= self.cycles
        until = time.process_time() + self.seconds / components
        return lambda done: done >= _LEAST_CYCLES and time.process_time() >= until


def compare_all(
    classes: Sequence[type[Component]], compiled: Sequence[Compiled], amount: Amount, seed: int = 1
) -> list[Comparison]:
    """Compare each class with its machine code; raise Mistake if the comparison cannot start."""
    size = _HEADER + max(each.description.record.itemsize for each in compiled)
    with mmap.mmap(-1, size) as shared:
        readable, writable = os.pipe()
        with warnings.catch_warnings():
            # Python warns of a fork while NumPy has threads.
            warnings.simplefilter("ignore", DeprecationWarning)
            child = os.fork()
        if child == 0:
            os.close(readable)
            with open(writable, "wb") as results:
                _work(classes, compiled, amount, seed, _Notes(shared), results)
        os.close(writable)
        found: list[Comparison] = []
        try:
            with open(readable, "rb") as results:
                while (result := _next(results)) is not None:
                    if isinstance(result, Mistake):
                        raise result
                    found.append(result)
        finally:
            status = os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])
        if len(found) < len(compiled):
            found.append(_end(compiled[len(found)], status, shared))
        return found


class _Notes:
    """Notes about the next hook, in shared memory."""

    def __init__(self, shared: mmap.mmap) -> None:
        self._shared = shared
        self._numbers: Any = np.ndarray(4, np.int64, shared)

    def record(self, dtype: Any) -> Any:
        """Return the memory of the record that compiled code works on."""
        return np.ndarray((), dtype, self._shared, _HEADER)

    def begin(self, component: int) -> None:
        """Note the component that is compared next."""
        self._numbers[_COMPONENT] = component

    @contextmanager
    def python(self) -> Iterator[None]:
        """Limit a hook in the interpreter; raises TimeLimitError."""
        with limited(HOOK_S):
            yield

    @contextmanager
    def machine_code(self, hook: int, cycle: int) -> Iterator[None]:
        """Limit a compiled hook; a timer kills this process."""
        self._numbers[_HOOK], self._numbers[_CYCLE] = hook, cycle
        self._numbers[_COMPILED] = True
        signal.setitimer(signal.ITIMER_PROF, HOOK_S)
        yield
        signal.setitimer(signal.ITIMER_PROF, 0.0)
        self._numbers[_COMPILED] = False


def _work(
    classes: Sequence[type[Component]],
    compiled: Sequence[Compiled],
    amount: Amount,
    seed: int,
    notes: _Notes,
    results: BinaryIO,
) -> None:
    """Run the comparisons in the child process."""
    status = 1
    try:
        signal.signal(signal.SIGPROF, signal.SIG_DFL)
        for number, (cls, machine_code) in enumerate(zip(classes, compiled, strict=True)):
            notes.begin(number)
            enough = amount.enough(len(compiled))
            found = compare(cls, machine_code, amount.cycles, seed, bounds=notes, enough=enough)
            pickle.dump(vars(found), results)
            results.flush()
        status = 0
    except Mistake as mistake:
        parts = (mistake.file, mistake.line, mistake.what, mistake.remedy, mistake.text)
        pickle.dump(parts, results)
        results.flush()
    except KeyboardInterrupt:
        pass  # Ctrl-C, which ends the parent, too
    except BaseException:
        traceback.print_exc()
    finally:
        os._exit(status)


def _next(results: BinaryIO) -> Comparison | Mistake | None:
    try:
        read = pickle.load(results)
    except EOFError:
        return None
    return Comparison(**read) if isinstance(read, dict) else Mistake(*read)


def _end(compiled: Compiled, status: int, shared: mmap.mmap) -> Comparison:
    """Return the result of a comparison whose process ended early."""
    numbers: Any = np.ndarray(4, np.int64, shared)
    hook, cycle, in_machine_code = (int(numbers[each]) for each in (_HOOK, _CYCLE, _COMPILED))
    record: Any = np.ndarray((), compiled.description.record, shared, _HEADER)
    line = int(record[own_field("line")]) if in_machine_code else 0
    del numbers, record  # the mapping cannot be closed while they refer to it
    result = Comparison(compiled.description.name)
    result.cycles = cycle
    name = compiled.hooks[hook]
    if not in_machine_code:
        result.differ(f"the comparison ended with status {status}", compiled.file)
    elif status == -signal.SIGPROF:
        result.endless(name, cycle, "compiled", compiled.file, enclosing_loop(compiled.file, line))
    else:
        what = signal.Signals(-status).name if status < 0 else f"status {status}"
        result.differ(
            f"{name}, cycle {cycle}: {what} compiled, none in the interpreter", compiled.file, line
        )
    return result

"""A trial run in the interpreter, which finds shapes that do not fit before a library is written.

numba knows the number of dimensions of an array but not their sizes; NumPy checks them at run time.
"""

import warnings
from typing import Any

import numpy as np
from rtcf.component import Component
from rtcf.component.declaration import Description, Input, Member, Queue, describe
from rtcf.component.interpreter import record_of
from rtcf.component.value_type import ValueType, number_of

from rtcf_compile.source import numpy_errors
from rtcf_compile.source.mistake import Mistake, source_line
from rtcf_compile.source.processor_time import HOOK_S, TimeLimitError, limited

_CYCLES = 20


def run(cls: type[Component], file: str) -> None:
    """Run some cycles with random values of a fixed seed; raise Mistake if shapes do not fit."""
    draw = np.random.default_rng(1)
    about = describe(cls)
    with warnings.catch_warnings(), np.errstate(all="ignore"):
        warnings.simplefilter("ignore")
        try:
            with limited(HOOK_S):
                _cycles(cls(), about, draw)
        except TimeLimitError:
            pass  # the comparison reports it
        except Exception as error:
            # The component's own exceptions are not errors here.
            line = _line(error, file)
            if said := numpy_errors.explained(error, source_line(file, line)):
                raise Mistake(file, line, *said) from None


def _cycles(component: Any, about: Description, draw: Any) -> None:
    component.start()
    for cycle in range(_CYCLES):
        for member in about.of(Input):
            _draw(record_of(component), member, draw, cycle)
        for member in about.of(Queue):
            getattr(component, member.name).put(_value(member.type, draw, cycle))
        component.cycle()
    component.safe()


def _draw(record: Any, member: Member, draw: Any, cycle: int) -> None:
    for leaf in member.leaves:
        record[member.name + leaf.field] = _value(leaf.type, draw, cycle)
        if leaf.is_variable:
            record[member.name + leaf.count] = leaf.type.count
    for flag in ("new", "valid", "connected"):
        record[f"{member.name}__{flag}"] = True


def _value(kind: ValueType, draw: Any, cycle: int) -> Any:
    if kind.enumeration:
        return draw.choice([number_of(each) for each in kind.enumeration])
    value = draw.normal(0.0, 10.0 ** (cycle % 4), kind.shape)
    if kind.is_bool:
        value = value > 0
    return np.asarray(value).astype(kind.scalar)


def _line(error: BaseException, file: str) -> int:
    line, trace = 0, error.__traceback__
    while trace is not None:
        if trace.tb_frame.f_code.co_filename == file:
            line = trace.tb_lineno
        trace = trace.tb_next
    return line

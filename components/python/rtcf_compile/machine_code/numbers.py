"""A compiler pass after numba's type inference. It rejects operations whose results in machine code
would differ from Python and NumPy:

- a NumPy number where only a Python number gives the same result in NumPy 1 and NumPy 2;
- arithmetic of NumPy bools, which NumPy computes as logic;
- a variable that is an int in one place and a float in another and may be a large int: compiled, it
  is a float, which has 53 bits.

It also notes the functions that compute with narrow numbers, which the rewriter then adapts.
"""

import builtins
import functools
import math
import operator
from collections.abc import Callable, Iterator
from types import CodeType
from typing import Any

import numpy as np
from numba.core import ir, types
from numba.core.compiler import DefaultPassBuilder
from numba.core.compiler_machinery import AnalysisPass, register_pass
from numba.core.errors import TypingError
from numba.core.typed_passes import NopythonTypeInference

from rtcf_compile.machine_code import backend, type_errors
from rtcf_compile.machine_code.identity import OwnCompiler
from rtcf_compile.machine_code.number_types import Operand, operand, plain_of, together
from rtcf_compile.rewriting import helpers, math_functions, numpy_functions, operators
from rtcf_compile.rewriting.functions import INT_BOUNDS, WRITTEN_CODE
from rtcf_compile.source.mistake import Mistake, Mistakes, joined

_LARGEST = 2**53  # floats represent all ints up to this
_TURNS = 2**31  # assumed limit of iterations of a loop
_COMPARISONS = tuple(operators.COMPARISONS.values())
_OPERATIONS = (*operators.BINARY.values(), *operators.SHIFTS.values(), *_COMPARISONS)
# On two NumPy bools these give a bool or raise; on two Python bools they give an int.
_ARITHMETIC = (
    *(operator.add, operator.sub, operator.mul, operator.floordiv, operator.mod, operator.pow),
)
_IN_PLACE = {getattr(operator, f"i{each.__name__.strip('_')}"): each for each in _OPERATIONS
             if hasattr(operator, f"i{each.__name__.strip('_')}")}  # fmt: skip
# Helpers that act as an operator, with the operator and the pairs of arguments that it combines.
_MEETING: dict[Callable[..., Any], tuple[Callable[..., Any], tuple[tuple[int, int], ...]]] = {
    **{own: (of, ((0, 1),)) for of, own in operators.OF.items()},
    **{own: (operators.BINARY[node], ((0, 1),)) for node, own in operators.OF_ELEMENTS.items()},
    **{own: (operators.BINARY[node], ((0, 1),)) for node, own in helpers.IN_PLACE.items()},
    **{own: (np.hypot, ((0, 1),)) for own, name in numpy_functions.BY_LIBM.items()
       if name in ("hypot", "arctan2")},
    helpers.rtcf_equal: (operator.eq, ((0, 1),)),
    helpers.rtcf_where: (np.where, ((1, 2),)),
    helpers.rtcf_pow: (operator.pow, ((0, 1),)),
    helpers.rtcf_negative_pow: (operator.pow, ((0, 1),)),
    numpy_functions.rtcf_clip: (np.clip, ((0, 1), (0, 2))),
}  # fmt: skip
# Functions that return Python numbers, always and for arguments that are Python numbers.
_PYTHONS = (
    *(len, bool, helpers.rtcf_to_int, helpers.rtcf_to_float, helpers.rtcf_floor, helpers.rtcf_ceil),
    *(helpers.rtcf_round, helpers.rtcf_index, helpers.rtcf_front, helpers.rtcf_age),
    *(helpers.rtcf_math_fmod, helpers.rtcf_math_pow, helpers.rtcf_is, helpers.rtcf_is_known),
    helpers.rtcf_same,
    *(helpers.rtcf_math_remainder, helpers.rtcf_round_to),
    operators.rtcf_plain,
    *helpers.MATH.values(),
    *(own for own in math_functions.BY_NAME.values() if own is not math_functions.rtcf_math_prod),
)
_AS_ARGUMENTS = (
    *(abs, max, min, numpy_functions.rtcf_abs, numpy_functions.rtcf_whole_pow, helpers.rtcf_pow),
    *(helpers.rtcf_negative_pow, helpers.rtcf_maybe, helpers.rtcf_or_old, helpers.rtcf_equal),
    *(helpers.rtcf_get, helpers.rtcf_items, operators.rtcf_negative, operators.rtcf_divmod),
    *(helpers.rtcf_copied, helpers.rtcf_reversed, helpers.rtcf_truth),
    math_functions.rtcf_math_prod,
    *operators.OF.values(),
    *operators.OF_ELEMENTS.values(),
    *helpers.IN_PLACE.values(),
)
# numba's ufuncs that match NumPy for narrow numbers: with one argument, or two of the same type.
_NARROW_UFUNCS = (
    *(np.floor, np.ceil, np.trunc, np.rint, np.sqrt, np.square, np.absolute, np.fabs, np.sign),
    *(np.negative, np.isnan, np.isfinite, np.isinf, np.signbit, np.logical_not, np.logical_and),
    *(np.logical_or, np.logical_xor, np.invert, np.fmin, np.fmax, np.copysign, np.fmod),
)
_FLOATS_ONLY = (np.floor, np.ceil, np.trunc, np.rint, np.sqrt, np.fabs, np.copysign, np.fmod)


class Stop(BaseException):
    """Ends a compilation from within numba, which would catch an Exception."""

    def __init__(self, mistake: Mistake) -> None:
        """Wrap an error."""
        self.mistake = mistake


class _NarrowError(Exception):
    """A function computes with narrow numbers."""


def compiler(narrow: set[CodeType], mistakes: Mistakes) -> Any:
    """Return numba's compiler with the pass, which adds the code of functions that compute with
    narrow numbers to `narrow`.

    `mistakes`: receives the type errors of each function.
    """
    own = {"narrow": narrow, "known_narrow": len(narrow), "mistakes": mistakes}
    return type("Compiler", (_Compiler,), own)


class _Compiler(OwnCompiler):
    narrow: set[CodeType]
    known_narrow: int  # before this compilation
    mistakes: Mistakes

    def compile_extra(self, func: Any) -> Any:
        """Compile a function; collect its errors."""
        try:
            result = super().compile_extra(func)
        except Exception as error:
            self.mistakes.add(*type_errors.mistakes(error, func))
            raise
        backend.mark_own(result.library, result.fndesc.llvm_func_name)
        return result

    def define_pipelines(self) -> list[Any]:
        """Return the pipelines of passes."""
        self.state.rtcf_narrow = self.narrow
        passes = DefaultPassBuilder.define_nopython_pipeline(self.state)
        passes.add_pass_after(_NumbersPass, NopythonTypeInference)
        passes.finalize()
        return [passes]


@register_pass(mutates_CFG=False, analysis_only=True)
class _NumbersPass(AnalysisPass):  # type: ignore[misc]
    _name = "rtcf_numbers"

    def __init__(self) -> None:
        AnalysisPass.__init__(self)

    def run_pass(self, state: Any) -> bool:
        """Check a function after type inference."""
        try:
            Numbers(state.func_ir, state.typemap).check()
        except _NarrowError:
            state.rtcf_narrow.add(vars(state.func_id.func)[WRITTEN_CODE])
        return False


class Numbers:
    """Checks the numbers in a function."""

    def __init__(self, function: Any, types_of: dict[str, Any]) -> None:
        """Read a function in numba's intermediate representation."""
        self._file = function.loc.filename
        self._is_own = WRITTEN_CODE in vars(function.func_id.func)
        self.bounds: dict[str, int] = vars(function.func_id.func).get(INT_BOUNDS, {})
        self._types = types_of
        self._assigned: dict[str, list[Any]] = {}
        self._statements: list[Any] = []
        for _, block in sorted(function.blocks.items()):
            for each in block.body:
                if isinstance(each, ir.Assign):
                    self._statements.append(each)
                    self._assigned.setdefault(each.target.name, []).append(each.value)

    def check(self) -> None:
        """Raise Stop for the errors, or _NarrowError for the first narrow number."""
        mistakes = Mistakes()
        for each in self._statements:
            self._line = each.loc.line
            try:
                self._joined(each)
                if isinstance(each.value, ir.Expr):
                    self._expression(each.value)
            except Stop as stop:
                mistakes.add(stop.mistake)
            except _NarrowError:
                if not mistakes.found:
                    raise
                break
        if mistakes.found:
            raise Stop(joined(mistakes.found))
        if any(map(self._becomes_float, self._statements)):
            Bounds(self).check()

    def stop(self, what: str, remedy: str, line: int = 0) -> Stop:
        """Return an error at a line (default: the current one)."""
        return Stop(Mistake(self._file, line or self._line, what, remedy))

    def _joined(self, assignment: Any) -> None:
        """Reject a variable that is a narrow number in one place and another type in another."""
        joined = self.number(assignment.target)
        for each in self._sources(assignment):
            number = self.number(each)
            if joined is None or number is None or number.is_array or not number.is_narrow:
                continue
            if number.dtype != joined.dtype:
                raise self.stop(
                    f"is {number.words} in one place and another type in another", plain_of(number)
                )

    def _sources(self, assignment: Any) -> list[Any]:
        """Return the variables whose values an assignment copies."""
        value = assignment.value
        if isinstance(value, ir.Var):
            return [value]
        if isinstance(value, ir.Expr) and value.op == "phi":
            return [each for each in value.incoming_values if each is not ir.UNDEFINED]
        return [value.value] if isinstance(value, ir.Expr) and value.op == "cast" else []

    def _becomes_float(self, assignment: Any) -> bool:
        """Tell whether an int becomes a float by assignment, or in max or min."""
        value, sources = assignment.value, self._sources(assignment)
        if isinstance(value, ir.Expr) and value.op == "call":
            sources = list(value.args) if self.function(value.func) in (max, min) else []
        return isinstance(self.type_of(assignment.target.name), types.Float) and any(
            isinstance(self.type_of(each.name), types.Integer) for each in sources
        )

    # Operators and calls.

    def _expression(self, value: Any) -> None:
        operation = self.operation(value)
        if operation is not None and value.op != "call":
            self._operator(value, operation, self.operands(value))
        elif value.op == "unary":
            self._unary(value)
        elif value.op == "call":
            self._call(value, self.function(value.func))

    def operation(self, value: Any) -> Callable[..., Any] | None:
        """Return the operator that an expression applies, or None."""
        if value.op == "binop":
            return value.fn  # type: ignore[no-any-return]
        if value.op == "inplace_binop":
            return value.immutable_fn  # type: ignore[no-any-return]
        if value.op == "call":
            met = _MEETING.get(_hashable(self.function(value.func)))
            return met[0] if met else None
        return None

    def operands(self, value: Any) -> list[Any]:
        """Return the operands of an operator or the arguments of a function."""
        if value.op == "call":
            return list(value.args)
        return [value.lhs, value.rhs]

    def _operator(self, value: Any, operation: Any, variables: list[Any]) -> None:
        numbers = [self.number(each) for each in variables]
        if None in numbers:
            return
        if all(each.is_bool for each in numbers if each):
            self._bools(operation, variables)
        if any(each.is_narrow for each in numbers if each):
            if operation in _COMPARISONS and not any(each.is_array for each in numbers if each):
                self._met(operation, variables)
            else:
                self._narrow()

    def _narrow(self) -> None:
        if self._is_own:
            raise _NarrowError

    def _bools(self, operation: Any, variables: list[Any]) -> None:
        """Reject arithmetic of bools, unless all are Python bools."""
        if operation not in _ARITHMETIC or all(map(self.is_python, variables)):
            return
        raise self.stop(
            "arithmetic of bools is logic in NumPy",
            "write a or b, a and b (a | b, a & b of arrays), or convert them: int(…), "
            "….astype(int)",
        )

    def _unary(self, value: Any) -> None:
        number = self.number(value.value)
        if number is None:
            return
        if number.is_narrow and value.fn in (operator.neg, operator.invert):
            if number.is_array:
                return
            if value.fn is operator.invert:
                raise self.stop(f"~ of {number.words}", plain_of(number))
            self._narrow()
        if number.is_bool and value.fn is operator.invert and not number.is_array:
            raise self.stop("~ of a bool is an int in Python", "write not")
        if number.is_bool and value.fn in (operator.neg, operator.pos) and not self.is_python(
            value.value
        ):  # fmt: skip
            raise self.stop("NumPy has no - and + of bools", "convert them: int(…)")

    def _call(self, value: Any, function: Any) -> None:
        function = _hashable(function)
        if function in _MEETING:
            operation, pairs = _MEETING[function]
            for pair in pairs:
                variables = [value.args[place] for place in pair if place < len(value.args)]
                numbers = [self.number(each) for each in variables]
                if len(variables) < 2 or None in numbers:
                    continue
                if all(each.is_bool for each in numbers if each):
                    self._bools(operation, variables)
                if function in operators.OF_ELEMENTS.values() and self._is_stored(*variables):
                    continue
                self._met(operation, variables)
        elif function in (helpers.rtcf_assign, helpers.rtcf_store, helpers.rtcf_set):
            self._set(value.args[0], value.args[-1])
        elif function is helpers.rtcf_bool:
            if isinstance(self.type_of(value.args[0].name), types.Integer):
                raise self.stop("a bool is set to an int", "compare it: x != 0")
        elif isinstance(function, np.ufunc):
            self._ufunc(value, function)
        elif getattr(function, "__module__", None) == "math":
            if any(number.is_narrow for each in value.args if (number := self.number(each))):
                self._narrow()
        elif function is sum and value.args:
            number = self.number(value.args[0])
            if number is not None and number.is_narrow:
                raise self.stop(f"sum of {number.words}", "use np.sum")
        elif function in (max, min) and len(value.args) > 1:
            self._extreme(value)

    def _is_stored(self, element: Any, value: Any) -> bool:
        """Tell whether `x[i] += n` changes an element of small ints, which wraps around.

        Reject a constant that does not fit the element.
        """
        one, other = self.number(element), self.number(value)
        if one is None or other is None or one.is_array or other.is_array:
            return False
        self._set(element, value)
        return one.dtype.kind in "iu" and other.dtype == np.int64

    def _set(self, target: Any, value: Any) -> None:
        """Reject setting elements to a constant that does not fit them."""
        number, constant = self.number(target), self.constant(value)
        if number is None or number.dtype.kind not in "iu" or type(constant) is not int:
            return
        if not operators.fits(constant, number.dtype):
            limits = np.iinfo(number.dtype)
            what = f"{constant} does not fit {number.dtype.name}"
            raise self.stop(what, f"use {limits.min} to {limits.max}")

    def _extreme(self, value: Any) -> None:
        """Reject max and min of numbers whose types also differ in Python."""
        numbers = [number for each in value.args if (number := self.number(each)) is not None]
        if len({each.dtype for each in numbers}) < 2:
            return
        for each in numbers:
            if each.is_narrow:
                raise self.stop(f"{each.words} among numbers of other types", plain_of(each))

    def _ufunc(self, value: Any, function: Any) -> None:
        """Check a NumPy function that numba implements."""
        numbers = [number for each in value.args if (number := self.number(each)) is not None]
        of = operators.UFUNCS.get(function)
        narrow = [each for each in numbers if each.is_narrow]
        if of is not None and len(numbers) == 2:
            if all(each.is_bool for each in numbers):
                self._bools(of, list(value.args))
            if narrow:
                self._narrow()
        if not narrow:
            return
        same = len({(each.dtype, each.is_array) for each in numbers}) == 1
        small = any(each.dtype.kind != "f" for each in narrow) and function in _FLOATS_ONLY
        if function not in _NARROW_UFUNCS or not same or small:
            raise self.stop(
                f"np.{function.__name__} of {narrow[0].words}",
                "convert it: x.astype(float)" if narrow[0].is_array else plain_of(narrow[0]),
            )

    def _met(self, operation: Any, variables: list[Any]) -> None:
        """Reject operations whose results differ between NumPy 1 and NumPy 2."""
        numbers = [self.number(each) for each in variables]
        one, other = numbers
        assert one is not None and other is not None
        if not one.is_narrow and not other.is_narrow:
            return
        is_exact = self._is_exact(variables, one, other)
        try:
            meeting = together(operation, one, other, is_exact)
        except TypingError as error:
            what, remedy = str(error.msg).removeprefix("RTCF:").split(":", 1)
            raise self.stop(what, remedy) from None
        for to, variable in ((meeting.left, variables[0]), (meeting.right, variables[1])):
            constant = self.constant(variable)
            if to is None or to.kind not in "iu" or type(constant) is not int:
                continue
            if not operators.fits(constant, to):
                raise self.stop(
                    f"{constant} does not fit {to.name}", "convert the array: x.astype(int)"
                )
        if meeting.weak is not None and not self.is_python(variables[meeting.weak]):
            array, number = (one, other) if one.is_array else (other, one)
            raise self.stop(
                f"{array.words} with a number that may be NumPy's gives {array.dtype.name} in "
                f"NumPy 1, {np.promote_types(array.dtype, number.dtype).name} in NumPy 2",
                plain_of(number),
            )

    def _is_exact(self, variables: list[Any], one: Operand, other: Operand) -> bool:
        """Tell whether the wider of two numbers is a constant that the narrow type represents."""
        for variable, number, narrow in ((variables[0], one, other), (variables[1], other, one)):
            constant = self.constant(variable)
            if not number.is_narrow and narrow.dtype == np.float32 and constant is not None:
                with np.errstate(all="ignore"):
                    return float(np.float32(constant)) == float(constant)
        return False

    # Properties of variables.

    def number(self, variable: Any) -> Operand | None:
        """Return the operand of a variable, or None."""
        return operand(self._types[variable.name])

    def type_of(self, name: str) -> Any:
        """Return the numba type of a variable."""
        return types.unliteral(self._types[name])

    def assignments(self) -> Iterator[Any]:
        """Yield all assignments."""
        yield from self._statements

    def function(self, variable: Any) -> Any:
        """Return the function that a variable refers to, or None."""
        values = self._assigned.get(variable.name, [])
        if len(values) != 1:
            return None
        value = values[0]
        if isinstance(value, ir.Global | ir.FreeVar):
            return value.value
        if isinstance(value, ir.Var):
            return self.function(value)
        if isinstance(value, ir.Expr) and value.op == "getattr":
            return getattr(self.function(value.value), value.attr, None)
        return None

    def constant(self, variable: Any) -> Any:
        """Return the constant value of a variable, or None."""
        values = self._assigned.get(variable.name, [])
        if len(values) != 1:
            return None
        value = values[0]
        if isinstance(value, ir.Const | ir.Global | ir.FreeVar):
            return value.value if type(value.value) in (int, float, bool) else None
        if isinstance(value, ir.Var):
            return self.constant(value)
        if isinstance(value, ir.Expr) and value.op == "unary" and value.fn is operator.neg:
            inner = self.constant(value.value)
            return None if inner is None else -inner
        return None

    def is_python(self, variable: Any) -> bool:
        """Tell whether a number is surely a Python number in the interpreter."""
        return variable.name in self._pythons

    @functools.cached_property
    def _pythons(self) -> set[str]:
        return self._find_pythons()

    def _find_pythons(self) -> set[str]:
        found = set(self._assigned)
        before = -1
        while len(found) != before:
            before = len(found)
            found = {
                name
                for name in found
                if all(self._gives_python(each, found) for each in self._assigned[name])
            }
        return found

    def _gives_python(self, value: Any, known: set[str]) -> bool:
        if isinstance(value, ir.Var):
            return value.name in known
        if isinstance(value, ir.Const | ir.Global | ir.FreeVar):
            return _is_pythons(value.value)
        if not isinstance(value, ir.Expr):
            return False
        if value.op == "getattr":
            return not isinstance(self._types.get(value.value.name), types.Array) or value.attr in (
                "shape", "size", "ndim",
            )  # fmt: skip
        if value.op == "call":
            function = _hashable(self.function(value.func))
            if function in _PYTHONS:
                return True
            given = [each.name for each in value.args
                     if not isinstance(self._types[each.name], types.Function)]  # fmt: skip
            return function in (*_AS_ARGUMENTS, range) and set(given) <= known
        if value.op == "static_getitem" and (item := self._item(value)) is not None:
            return item.name in known
        if value.op in ("getitem", "static_getitem", "typed_getitem"):
            is_array = isinstance(self._types[value.value.name], types.Array)
            return not is_array and value.value.name in known
        if value.op in ("getiter", "iternext", "pair_first", "exhaust_iter", "cast", "unary"):
            kind = self._types.get(value.value.name)
            return not isinstance(kind, types.Array) and value.value.name in known
        if value.op == "phi":
            return all(each is ir.UNDEFINED or each.name in known for each in value.incoming_values)
        if value.op == "build_tuple":
            return all(each.name in known for each in value.items)
        if value.op in ("binop", "inplace_binop"):
            return {value.lhs.name, value.rhs.name} <= known
        return False

    def _item(self, value: Any) -> Any:
        """Return the variable that is an element of a tuple; None if unknown."""
        made = self._assigned.get(value.value.name, [])
        while len(made) == 1 and (
            isinstance(made[0], ir.Var)
            or (isinstance(made[0], ir.Expr) and made[0].op == "exhaust_iter")
        ):
            of = made[0] if isinstance(made[0], ir.Var) else made[0].value
            made = self._assigned.get(of.name, [])
        if len(made) == 1 and isinstance(made[0], ir.Expr) and made[0].op == "build_tuple":
            return made[0].items[value.index] if isinstance(value.index, int) else None
        return None


def _is_pythons(value: Any) -> bool:
    if isinstance(value, tuple):
        return all(map(_is_pythons, value))
    return not isinstance(value, np.generic | np.ndarray)


def _hashable(function: Any) -> Any:
    try:
        hash(function)
    except TypeError:
        return None
    return function


class Bounds:
    """Bounds the ints in Python of variables that are floats when compiled.

    A bound is None for a variable that is never an int. The analysis follows some iterations of
    each loop. A bound that grows by a constant per iteration is multiplied by the limit of
    iterations; one that grows faster is infinite.
    """

    def __init__(self, numbers: Numbers) -> None:
        """Compute the bounds of the variables of a function."""
        self._numbers = numbers
        self._bounds: dict[str, float | None] = {}
        history: list[dict[str, float | None]] = []
        for _ in range(12):
            for each in numbers.assignments():
                self._bounds[each.target.name] = self._join(
                    self._bounds.get(each.target.name), self._bound(each)
                )
            history.append(dict(self._bounds))
        self._widen(history)

    def check(self) -> None:
        """Raise Stop for a float that may be a large int in Python."""
        for each in self._numbers.assignments():
            name = each.target.name
            if isinstance(self._numbers.type_of(name), types.Float):
                self._check(each)

    def _check(self, assignment: Any) -> None:
        bound = self._bounds.get(assignment.target.name)
        if bound is None or bound <= _LARGEST:
            return
        name = self._joined_name(assignment)
        subject = f"{name} is" if name.isidentifier() and not name.startswith("rtcf_") else "is"
        raise self._numbers.stop(
            f"{subject} an int in one place and a float, which has 53 bits, in another",
            "convert the int: float(…)",
            self._line(assignment),
        )

    def _joined_name(self, assignment: Any) -> str:
        """Return the variable that is an int and a float: the target, or a float operand."""
        value, names = assignment.value, [assignment.target.name]
        if isinstance(value, ir.Expr) and self._numbers.operation(value) is not None:
            names = [
                each.name
                for each in self._numbers.operands(value)
                if isinstance(self._numbers.type_of(each.name), types.Float)
            ] or names
        return str(names[0]).partition(".")[0]

    def _line(self, assignment: Any) -> int:
        """Return the line that sets an int among joined values, else the line of the assignment."""
        value = assignment.value
        if isinstance(value, ir.Expr) and value.op == "phi":
            names = {each.name for each in value.incoming_values if each is not ir.UNDEFINED}
            for each in self._numbers.assignments():
                is_int = isinstance(self._numbers.type_of(each.target.name), types.Integer)
                if each.target.name in names and is_int:
                    return int(each.loc.line)
        return int(assignment.loc.line)

    def _widen(self, history: list[dict[str, float | None]]) -> None:
        last, before, first = history[-1], history[-2], history[-3]
        for name, bound in last.items():
            values = (bound, before.get(name), first.get(name))
            if None in values or values[0] == values[1]:
                continue
            a, b, c = (float(each) for each in values if each is not None)
            grows_evenly = math.isclose(a - b, b - c)
            self._bounds[name] = a + (a - b) * _TURNS if grows_evenly else math.inf

    def _join(self, one: float | None, other: float | None) -> float | None:
        if one is None or other is None:
            return other if one is None else one
        return max(one, other)

    def _of(self, variable: Any) -> float | None:
        return self._bounds.get(variable.name)

    def _bound(self, assignment: Any) -> float | None:
        value, kind = assignment.value, self._numbers.type_of(assignment.target.name)
        number = operand(kind)
        is_range = isinstance(kind, types.RangeType | types.RangeIteratorType | types.Pair)
        if isinstance(value, ir.Const | ir.Global | ir.FreeVar):
            given = value.value
            return float(abs(given)) if type(given) in (int, bool) else None
        if isinstance(value, ir.Var):
            return self._of(value)
        if isinstance(value, ir.Arg) and value.name in self._numbers.bounds:
            return float(self._numbers.bounds[value.name])
        bound = self._of_expression(value) if isinstance(value, ir.Expr) else None
        if bound is None and number is not None and not number.is_array:
            return _by_type(number.dtype)
        return bound if number is None or number.is_array or is_range else min(
            bound if bound is not None else math.inf, _by_type(number.dtype) or math.inf
        )  # fmt: skip

    def _of_expression(self, value: Any) -> float | None:
        if value.op == "phi":
            result: float | None = None
            for each in value.incoming_values:
                if each is not ir.UNDEFINED:
                    result = self._join(result, self._of(each))
            return result
        if value.op in ("cast", "unary", "getiter", "iternext", "pair_first"):
            return self._of(value.value)
        operation = self._numbers.operation(value)
        if operation is not None and operation not in (np.where, np.clip, np.hypot):
            return self._of_operator(operation, self._numbers.operands(value)[:2])
        if value.op == "call":
            function = _hashable(self._numbers.function(value.func))
            if function is len:
                return float(_TURNS)
            if function in (abs, max, min, range, numpy_functions.rtcf_abs, builtins.divmod):
                result = None
                for each in value.args:
                    result = self._join(result, self._of(each))
                return result
            if function is helpers.rtcf_index:
                return self._of(value.args[0])
        return None

    def _of_operator(self, operation: Any, variables: list[Any]) -> float | None:
        bounds = [self._of(each) for each in variables]
        if operation in _COMPARISONS:
            return 1.0
        if None in bounds or operation is operator.truediv:
            return None
        left, right = (float(each) for each in bounds if each is not None)
        if operation in (operator.add, operator.sub, operator.or_, operator.xor):
            return left + right
        if operation is operator.mul:
            return left * right
        if operation is operator.mod:
            return right
        if operation in (operator.floordiv, operator.rshift, np.minimum, np.maximum):
            return left
        if operation is operator.and_:
            return max(left, right)
        return math.inf


def _by_type(dtype: np.dtype[Any]) -> float | None:
    """Return the largest absolute int of a type; None for floats."""
    if dtype.kind == "b":
        return 1.0
    return float(max(abs(np.iinfo(dtype).min), np.iinfo(dtype).max)) if dtype.kind in "iu" else None

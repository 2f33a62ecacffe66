"""Mistakes of engineers who know Python and NumPy in a component: their code, and words of the
compiler's message.

`# here` marks the line that the message must name, unless it is the only one.
"""

MODULE = """\
import asyncio
import contextlib
import enum
import functools
import itertools
import logging
import math
import random
import threading
import time
from collections import deque, namedtuple
from dataclasses import dataclass, field
from typing import Any

import numba
import numpy as np
from geometry_msgs.msg import PoseArray, PoseStamped, Twist
from rtcf.component import Component, Derived, Input, Output, Parameter, Queue, State
from sensor_msgs.msg import JointState
from std_msgs.msg import String

A = np.eye(2)
B = np.ones((3, 2))
TABLE = [1.0, 2.0, 3.0]
LIMITS = (0.5, 1.5)
BLOCK = np.ones((2, 2, 2))
GAINS = {"kp": 1.0}
NAMES = ["arm", "leg"]
POINTS = [[1.0, 2.0], [3.0]]
HISTORY = deque(maxlen=4)
TOTAL = 0.0
log = logging.getLogger(__name__)


class Mode(enum.IntEnum):
    OFF = 0
    RUN = 1


class Colour(enum.Enum):
    RED = "red"


@dataclass
class Gains:
    kp: float = 1.0


class Filter:
    def __init__(self, size):
        self.size = size

    def step(self, x):
        return x / self.size


FILTER = Filter(3.0)
SHARED = Gains()


@functools.lru_cache(maxsize=4)
def cached(x):
    return x


def timed(hook):
    def inner(self):
        return hook(self)

    return inner


def wrapped(hook):
    @functools.wraps(hook)
    def inner(self):
        return hook(self)

    return inner


class Timed:
    def __init__(self, hook):
        self.hook = hook

    def __call__(self, *given):
        return self.hook(*given)


def limited(x, low, high=1.0):
    return min(max(x, low), high)


"""

MEMBERS = """\
class Faulty(Component):
    u: Input[float]
    w: Input[np.float64, 2]
    t: Input[Twist]
    y: Output[float]
    x: Output[np.float64, 2]
    p: Output[PoseStamped]
    q: Queue[float] = Queue(size=4)
    kp: Parameter[float] = Parameter(1.0)
    gains: Parameter[np.float64, 2] = Parameter([1.0, 2.0])
    d: Derived[float]
    n: State[int]
    f: State[float]
    on: State[bool]
    z: State[np.float64, 2]
    held: State[np.float64, 2]
    m: State[np.float64, 2, 2]
    c: State[np.int64, 3]
    o: State[float | None]
    mode: State[Mode]
    g: State[np.float32, 2]
    h: State[np.uint8, 2]
    s: State[np.float64, 2, 2, 2]
    LIMIT = 2.0
"""

# In update.
UPDATE: dict[str, tuple[str, str]] = {
    # Names.
    "parameter without self": ("self.f = kp * 2.0", "write self.kp"),
    "period without self": ("self.f = dt", "dt is not defined"),
    "misspelt variable": ("total = 1.0\nself.f = totl  # here", "total"),
    "output called": ("self.y(1.0)", "self.y.write(…)"),
    "input called": ("self.f = self.u()", "self.u.value"),
    "method of an enum": ("self.n = self.mode.bit_length()", "an enum"),
    "seconds of a stamp": ("self.f = self.stamp.to_sec()", "1e-9"),
    "sleep": ("time.sleep(0.1)", "blocks the cycle"),
    "thread": ("threading.Thread(target=None)", "starts no threads"),
    "port declared in a hook": ("a = Output(float)", "write `name: Output[float]`"),
    "kind of sort": ("a = np.argsort(self.z, kind='mergesort')", 'kind="stable"'),
    "cached function": ("self.f = cached(self.f)", "lru_cache"),
    # Names of arrays.
    "state set to another, then changed": (
        "self.z = self.held\nself.z[0] = 1.0  # here",
        "the same array",
    ),
    "state set to another, then increased": (
        "self.z = self.held\nself.held += 1.0  # here",
        "write self.z = self.held.copy()",
    ),
    "row kept in a state, then the matrix changed": (
        "self.z = self.m[0]\nself.m[0, 0] = 1.0  # here",
        "write self.z = self.m[0].copy()",
    ),
    "variable kept in a state, then changed": (
        "a = np.zeros(2)\nself.z = a\na[0] = 1.0  # here",
        "write self.z = a.copy()",
    ),
    "constant kept in a state, then changed": (
        "self.m = A\nself.m[0, 0] = 2.0  # here",
        "self.m = A.copy()",
    ),
    "parameter changed by a name": (
        "a = self.gains\na[0] = 2.0  # here",
        "write a = self.gains.copy()",
    ),
    "diagonal changed": ("a = np.diag(self.m)\na[0] = 1.0  # here", "read-only view"),
    "tuple with an array twice": (
        "a = (self.z, self.z)\nself.z = 2.0 * self.z\na[0][0] = 1.0  # here\nself.x.write(a[1])",
        "the same array",
    ),
    "matrix product in place": ("self.m @= self.m", "version of NumPy"),
    "ellipsis among indices": ("self.z[:] = self.m[..., 0]", "among other indices"),
    "input changed through a function": ("np.asarray(self.w.value)[0] = 1.0", "an Input"),
    "power that is the matrix itself": (
        "a = np.linalg.matrix_power(self.m, 1)\na[0, 0] = 1.0  # here",
        "the same array",
    ),
    "pair of one array": (
        "a, b = self.z, self.z\nself.z = 2.0 * self.z\na += 1.0  # here\nself.x.write(b)",
        "the same array",
    ),
    # Shapes.
    "vector of another size added": ("self.z[:] = self.z + np.zeros(3)", "(2,)"),
    "vector of another size assigned": ("self.z[:] = np.ones(3)", "(3,)"),
    "state set to another size": ("self.z = np.ones(3)", "(3,)"),
    "output written in another size": ("self.x.write(np.zeros(3))", "(3,)"),
    "matrix written to a vector": ("self.x.write(self.m)", "matrix"),
    "vector written to a number": ("self.y.write(self.w.value)", "vector"),
    "list written to a number": ("self.y.write([1.0])", "list or tuple"),
    "number of values of a list": ("self.x.write([1.0, 2.0, 3.0])", "(3,)"),
    "inner sizes of a product": ("self.z[:] = B @ np.ones(3)", "sizes 2 and 3"),
    "product in the wrong order": ("self.z[:] = self.z @ B", "sizes 2 and 3"),
    "product of numbers": ("self.f = self.kp @ self.f", "@"),
    "product of a number and a vector": ("self.z[:] = self.kp @ self.z", "@"),
    "dot of other sizes": ("self.f = np.dot(self.z, np.ones(3))", "(3,)"),
    "solve of other sizes": ("self.z[:] = np.linalg.solve(self.m, np.ones(3))", "sizes 2 and 3"),
    "inverse of a vector": ("self.m[:] = np.linalg.inv(self.z)", "matri"),
    "inverse of a rectangle": ("self.m[:] = np.linalg.inv(B)", "square"),
    "determinant of a vector": ("self.f = np.linalg.det(self.z)", "matri"),
    "trace of a vector": ("self.f = np.trace(self.z)", "matri"),
    "reshape to another size": ("self.m[:] = self.z.reshape(2, 2)", "reshape"),
    "reshape to four sizes": ("a = self.m.reshape(1, 1, 2, 2)", "one to three"),
    "part of three dimensions in another shape": (
        "a = self.s[:, 1:].reshape(4)",
        "copy it first",
    ),
    "part of a matrix in three dimensions": (
        "a = self.m[:, 1:].reshape(1, 1, 2)",
        "copy it first",
    ),
    "matrix kept in three dimensions": ("self.s = self.m", "3 dimensions"),
    "vector added to three dimensions": ("self.s[:] = self.s + np.zeros(3)", "(3,)"),
    "product of three dimensions": ("a = self.s @ self.z", "use its matrices"),
    "inverse of three dimensions": ("a = np.linalg.inv(self.s)", "a matrix"),
    "sort of three dimensions": ("a = np.sort(self.s)", "3 dimensions"),
    "sort of three dimensions in place": ("self.s.sort()", "3 dimensions"),
    "sums of three dimensions along an axis": ("a = np.cumsum(self.s, axis=1)", "3 dimensions"),
    "three dimensions joined": ("a = np.concatenate((self.s, self.s))", "3 dimensions"),
    "trace of three dimensions": ("self.f = np.trace(self.s)", "3 dimensions"),
    "array as an index of three dimensions": ("a = self.s[[0, 1]]", "a whole mask"),
    "mask of rows of three dimensions": ("self.s[self.z > 0.0] = 0.0", "a whole mask"),
    "new axis of a number": ("a = self.f[None]", "a new axis"),
    "hstack of other heights": ("a = np.hstack((self.m, B))", "fit"),
    "ragged array": ("a = np.array([[1.0, 2.0], [3.0]])", "rows"),
    "ragged constant": ("a = np.array(POINTS)", "rows"),
    "axis beyond the dimensions": ("self.f = np.sum(self.z, axis=1)", "axis"),
    "axis of a matrix too large": ("self.z[:] = self.m.sum(axis=2)", "axis"),
    "axis as text": ("self.z[:] = self.m.sum(axis='x')", "text"),
    "row of another size": ("self.m[0] = np.ones(3)", "(3,)"),
    "column of another size": ("self.m[:, 0] = np.ones(3)", "(3,)"),
    "mask of another size": ("self.z[self.c > 0] = 0.0", "mask"),
    "where of other sizes": ("self.z[:] = np.where(self.c > 0, 1.0, self.z)", "shape"),
    "comparison of other sizes": ("a = np.any(self.z > self.c)", "shape"),
    "unpacked into too many": ("a, b, c = self.z", "3"),
    "unpacked into too few": ("(a,) = self.z", "1"),
    "unpacked number": ("a, b = self.kp", "float"),
    "interp of other sizes": ("self.f = np.interp(self.f, self.z, self.c)", "points"),
    "concatenate of other dimensions": ("a = np.concatenate((self.z, self.m))", "vectors"),
    "concatenate without parentheses": ("a = np.concatenate(self.z, self.z)", "arrays"),
    # Indices.
    "constant index beyond the size": ("self.f = self.z[2]", "2 elements"),
    "constant index before the first": ("self.f = self.z[-3]", "2 elements"),
    "constant index of an input": ("self.f = self.w.value[5]", "2 elements"),
    "constant index of a parameter": ("self.f = self.gains[2]", "2 elements"),
    "constant row beyond the size": ("self.f = self.m[2, 0]", "2 rows"),
    "constant column beyond the size": ("self.f = self.m[0, 2]", "2 columns"),
    "constant index along the last axis": ("self.f = self.s[0, 0, 2]", "2 elements along axis 2"),
    "constant index along the first axis": ("self.m[:] = self.s[2]", "2 elements along axis 0"),
    "four indices": ("self.f = self.s[0, 0, 0, 0]", "3 dimensions"),
    "constant index of a constant": ("self.f = TABLE[3]", "3 elements"),
    "constant index of a tuple": ("self.f = LIMITS[2]", "2 elements"),
    "constant index set": ("self.c[3] = 1", "3 elements"),
    "float as index": ("self.f = self.z[0.5]", "float"),
    "quotient as index": ("self.f = self.z[self.n / 2]", "float"),
    "text as index": ("self.f = self.z['a']", "text"),
    "bool as index": ("self.f = self.z[self.on]", "bool"),
    "three indices": ("self.f = self.m[0, 0, 0]", "matri"),
    "two indices of a vector": ("self.f = self.z[0, 0]", "vector"),
    "index of a number": ("self.f = self.kp[0]", "no elements"),
    "index of an int": ("self.n = self.n[0]", "int"),
    "index of a port": ("self.f = self.w[0]", "Input"),
    "index called": ("self.f = self.z(0)", "[0]"),
    "step of 0": ("self.z[:] = self.z[::0]", "step"),
    "float slice": ("self.z[:] = self.z[0.0:2]", "not an int"),
    "float variable as a bound": ("self.z[:] = self.z[self.kp : 2]", "not an int"),
    "two indices of a list": ("self.f = TABLE[0, 1]", "not an array"),
    "index of None": ("self.f = self.z[self.o]", "None"),
    "tuple at a variable place": ("self.f = (1.0, 2, True)[self.n]", "types"),
    # Types.
    "float to an int": ("self.n = self.f", "float"),
    "quotient to an int": ("self.n = self.n / 2", "float"),
    "float added to an int": ("self.n += 0.5", "float"),
    "float to elements of ints": ("self.c[:] = np.zeros(3)", "int64"),
    "float added to elements of ints": ("self.c += 0.5", "float"),
    "element of ints divided": ("self.c[0] /= 2", "float"),
    "int to a bool": ("self.on = self.n", "int"),
    "text to a number": ("self.f = 'fast'", "text"),
    "number from a word": ("self.f = float('fast')", "text"),
    "text in arithmetic": ("self.f = self.f + '1'", "text"),
    "mode as text": ("self.mode = 'RUN'", "Mode"),
    "mode by its name in brackets": ("self.mode = Mode['RUN']", "Mode"),
    "mode set to a float": ("self.mode = 1.0", "Mode"),
    "mode of a float": ("self.mode = Mode(self.f)", "Mode"),
    "member that an enum has not": ("self.mode = Mode.STOP", "STOP"),
    "mode counted up": ("self.mode += 0.5", "Mode"),
    "modes in a loop": ("for each in Mode:\n    self.n += each", "Mode"),
    "None to a number": ("self.f = None", "None"),
    "None to an array": ("self.z = None", "None"),
    "None written": ("self.y.write(None)", "None"),
    "truth of None": ("if self.o:\n    self.n = 1", "None"),
    "truth of an array": ("if self.z:  # here\n    self.n = 1", "any"),
    "truth of a comparison of arrays": ("if self.z > 0.0:  # here\n    self.n = 1", "any"),
    "chained comparison of arrays": ("a = 0.0 < self.z < 1.0", "any"),
    "arrays joined by and": ("a = self.z > 0.0 and self.z < 1.0", "any"),
    "negated array": ("a = not self.z", "any"),
    "array in a while": ("while self.z > 0.0:  # here\n    self.z -= 1.0", "any"),
    "float of a vector": ("self.f = float(self.z)", "vector"),
    "int of a vector": ("self.n = int(self.z)", "vector"),
    "bool of a vector": ("self.on = bool(self.z)", "np.any"),
    "math of a vector": ("self.z[:] = math.sin(self.z)", "vector"),
    "comparison with and in one": ("self.on = self.z & self.on", "&"),
    "bits of a float": ("self.n = self.f & 1", "&"),
    "shift of a float": ("self.n = self.f << 1", "<<"),
    "bools added": ("self.n = (self.z[0] > 0.0) + (self.z[1] > 0.0)", "logic"),
    "masks added": ("a = (self.z > 0.0) - (self.z < 0.0)", "logic"),
    "inverted bool": ("self.on = ~self.on", "not"),
    "negated mask": ("self.on = -(self.z[0] > 0.0)", "bools"),
    "int or float": (
        "a = self.n\nif self.on:\n    a = 0.5\nself.f = a",
        "a is an int in one place and a float",
    ),
    "largest of an int and a float": ("self.f = max(self.n, 0.5)", "an int in one place"),
    "negative element of small ints": ("self.h[0] = -1", "-1 does not fit uint8"),
    "number that does not fit its array": ("a = self.h + 256", "256 does not fit uint8"),
    "small ints changed by ints": ("self.h += self.c[:2]", "uint8"),
    "element of float32 with a number": ("self.f = self.g[0] * 0.1", "NumPy 2"),
    "array of float32 with an element": ("self.f = np.sum(self.g * self.z[0])", "NumPy 2"),
    "polynomial of float32": ("self.f = np.polyval(self.g, self.f)", "np.polyval"),
    "sum of float32": ("self.f = sum(self.g)", "np.sum"),
    "sine of small ints": ("a = np.sin(self.h)", "np.sin"),
    "element of float32, or a float": (
        "a = self.g[0] if self.on else self.f  # here\nself.n += 1",
        "float32",
    ),
    "inverted float": ("self.f = ~self.f", "~"),
    "range of a float": ("for i in range(self.kp):  # here\n    self.n += i", "range"),
    "loop over a number": ("for i in self.n:  # here\n    self.n += 1", "int"),
    "loop over a float": ("for i in self.kp:  # here\n    self.n += 1", "float"),
    "length of a number": ("self.n = len(self.kp)", "float"),
    "sum of a number": ("self.f = sum(self.kp)", "float"),
    "two types of a variable": (
        "a = 0.0\nif self.on:\n    a = self.z\nself.y.write(a)  # here",
        "a is",
    ),
    "number or nothing": ("a = self.f if self.on else self.z  # here\nself.f = a", "float"),
    "matrix in the place of a vector": (
        "a = self.z\nif self.on:\n    a = self.m\nself.f = a[0]  # here",
        "a",
    ),
    "order of complex numbers": ("a = 1.0 if self.f * 1j > 2.0 else 0.0", "abs(z)"),
    "complex number set to elements": ("self.z[:] = 1j * self.z", ".real"),
    "root of a complex number": ("self.f = abs(math.sqrt(1j * self.f))", "cmath"),
    "complex function": ("self.f = complex(self.f, 1.0)", "complex"),
    "type complex64": ("a = np.zeros(2, dtype=np.complex64)", "number type"),
    "type object": ("a = np.zeros(2, dtype=object)", "number type"),
    "type as unknown text": ("a = np.zeros(2, dtype='real')", "number type"),
    "type of text": ("a = np.array(['a', 'b'])", "text"),
    "size that is known late": ("a = np.zeros(self.kp)", "float"),
    "size as a float": ("a = np.zeros(2.0)", "float"),
    "bytes": ("a = b'1'", "bytes"),
    "big int": ("self.n = 10**19", "int64"),
    "none of the operators": ("self.f = self.o + 'a'", "text"),
    "list minus list": ("a = [1.0, 2.0] - [1.0, 1.0]", "list"),
    "negated list": ("a = -[1.0, 2.0]", "np.array"),
    "list times a float": ("a = [1.0, 2.0] * self.kp", "list"),
    "tuple minus tuple": ("a = (1.0, 2.0) - (1.0, 1.0)", "np.array"),
    "tuple times a float": ("a = (1.0, 2.0) * self.kp", "np.array"),
    "tuple element set": ("a = (1.0, 2.0)\na[0] = 2.0  # here", "list or tuple"),
    "elements of a constant tuple": ("LIMITS[0] = 1.0", "LIMITS"),
    # NumPy's functions.
    "einsum to four dimensions": (
        "a = np.einsum('ij,kl->ijkl', self.m, self.m)",
        "at most 3 dimensions",
    ),
    "einsum that transposes a block": (
        "a = np.einsum('ijk->kji', BLOCK)",
        "this is a view of a block: write a loop over its matrices",
    ),
    "einsum of variable subscripts": ("a = np.einsum(NAMES[0], self.z)", "constant subscripts"),
    "einsum with ellipsis": ("a = np.einsum('...i,i', self.m, self.z)", "any number"),
    "einsum of four operands": (
        "a = np.einsum('i,i,i,i->', self.z, self.z, self.z, self.z)",
        "more than 3 operands",
    ),
    "einsum with an order": ("a = np.einsum('ii', self.m, optimize=True)", "optimize"),
    "einsum of too many operands": ("a = np.einsum('ij', self.m, self.z)", "operands, not 2"),
    "einsum of other dimensions": ("a = np.einsum('ij,j->i', self.z, self.z)", "a vector of"),
    "einsum of other sizes": ("a = np.einsum('ij,j->i', self.m, self.c)", "np.einsum"),
    "einsum to unknown subscripts": ("a = np.einsum('ij->ik', self.m)", "not those of"),
    "einsum of bools": ("a = np.einsum('i->', self.z > 0.0)", "np.einsum of"),
    "fft": ("a = np.fft.fft(self.z)", "fft"),
    "eig": ("a, b = np.linalg.eig(self.m)", "LAPACK"),
    "svd": ("a = np.linalg.svd(self.m)", "LAPACK"),
    "pinv": ("a = np.linalg.pinv(self.m)", "LAPACK, which allocates memory: write A.T @ np."),
    "lstsq": ("a = np.linalg.lstsq(self.m, self.z)", "LAPACK"),
    "qr": ("a = np.linalg.qr(self.m)", "LAPACK"),
    "kron of vectors": ("a = np.kron(self.z, self.z)", "np.kron"),
    "convolve of a matrix": ("a = np.convolve(self.m, self.z)", "np.convolve of a matrix"),
    "correlate with another mode": ("a = np.correlate(self.z, self.z, 'all')", "mode='all'"),
    "tensordot": ("a = np.tensordot(self.m, self.m)", "np.tensordot"),
    "gradient with two steps": ("a = np.gradient(self.z, 0.1, 0.2)", "with 2 arguments"),
    "polyfit": ("a = np.polyfit(self.z, self.z, 1)", "np.polyfit"),
    "meshgrid of three": ("a = np.meshgrid(self.z, self.z, self.z)", "np.meshgrid of 3"),
    "roll by a float": ("a = np.roll(self.z, self.f)", "np.roll by a float"),
    "select of floats": ("a = np.select([self.z], [self.z])", "a condition is a vector"),
    "select of numbers": ("a = np.select([self.on], [self.f])", "np.select of numbers"),
    "select without choices": ("a = np.select([self.z > 0.0], [])", "a list that grows"),
    "nan_to_num in place": ("np.nan_to_num(self.z, copy=False)", "remove copy"),
    "norm by singular values": ("a = np.linalg.norm(self.m, 2)", "singular values"),
    "square root of a float as an int": ("self.n = math.isqrt(self.f)", "math.isqrt of a float"),
    "sum of a number by fsum": ("self.f = math.fsum(self.f)", "math.fsum of a float"),
    "hypot of an array": ("self.f = math.hypot(self.z)", "math.hypot of a vector"),
    "product of a matrix by math": ("self.f = math.prod(self.m)", "math.prod of a matrix"),
    "unique": ("a = np.unique(self.c)", "np.unique"),
    "tile": ("a = np.tile(self.m, 2)", "np.tile"),
    "repeat": ("a = np.repeat(self.z, self.c[:2])", "np.repeat"),
    "percentile by another method": (
        "a = np.percentile(self.z, 50, method='nearest')",
        "method='nearest'",
    ),
    "vectorize": ("a = np.vectorize(limited)(self.z)", "np.vectorize"),
    "apply_along_axis": ("a = np.apply_along_axis(np.sum, 0, self.m)", "np.apply_along_axis"),
    "block": ("a = np.block([[self.m, self.m]])", "np.block"),
    "matrix class": ("a = np.matrix([[1.0, 2.0]])", "np.matrix"),
    "loadtxt": ("a = np.loadtxt('gains.txt')", "np.loadtxt"),
    "save": ("np.save('z.npy', self.z)", "np.save"),
    "append to an array": ("self.z = np.append(self.z, self.f)", "(2,)"),
    "delete of an array": ("self.z = np.delete(self.z, 0)", "size of an array"),
    "insert into an array": ("self.z = np.insert(self.z, 0, 1.0)", "size of an array"),
    "resize": ("a = np.resize(self.z, 3)", "size of an array"),
    "method that arrays have not": ("self.z.push(1.0)", "push"),
    "method of arrays that is not there": ("a = self.z.tobytes()", "tobytes"),
    "unsorted kind": ("a = np.argsort(self.z)", "stable"),
    "out of a function": ("np.sin(self.z, out=self.z)", "sin"),
    "out of a sum": ("np.sum(self.m, axis=0, out=self.z)", "np.sum"),
    "keyword that a function has not": ("a = np.zeros(2, size=3)", "size"),
    "keyword misspelt": ("a = np.linspace(0.0, 1.0, n=5)", "np.linspace"),
    "argument missing": ("a = np.clip()", "np.clip"),
    "argument too many": ("a = np.dot(self.z, self.z, self.z)", "np.dot"),
    "argument missing of math": ("self.f = math.atan2(self.f)", "atan2"),
    "type of NumPy of an array": ("a = np.int32(self.z)", "vector"),
    "length of nothing": ("self.n = len()", "len takes"),
    "largest of nothing": ("self.f = max()", "needs"),
    "function misspelt": ("self.f = np.squrt(self.f)", "squrt"),
    "constant misspelt": ("self.f = np.PI", "PI"),
    "function of math misspelt": ("self.f = math.sinus(self.f)", "sinus"),
    "function without its call": ("self.f = np.sum", "function"),
    "own function without its call": ("self.f = limited", "function"),
    "number called": ("self.f = self.kp(1.0)", "not a function"),
    "constant called": ("self.f = A(0)", "not a function"),
    "norm of a text": ("self.f = np.linalg.norm(self.z, 'max')", "max"),
    "random vector": ("self.z[:] = np.random.randn(2)", "replay"),
    "random generator": ("rng = np.random.default_rng(1)", "replay"),
    "errstate": (
        "with np.errstate(all='raise'):  # here\n    self.f = 1.0 / self.f",
        "open or lock",
    ),
    "printoptions": ("np.set_printoptions(precision=3)", "np.set_printoptions"),
    "itertools": (
        "for a, b in itertools.product((1, 2), (3, 4)):  # here\n    self.n += a",
        "itertools",
    ),
    "functools": ("a = functools.reduce(limited, (1.0, 2.0))", "functools"),
    # Statements.
    "list that grows": ("values = []\nvalues.append(1.0)  # here", "cannot grow"),
    "list comprehension": ("a = [2.0 * each for each in self.z]  # here\nb = a", "list"),
    "dict": ("a = {'kp': 1.0}  # here\na['ki'] = 2.0", "dict"),
    "key that a dict has not": ("self.f = GAINS['kd']", "'kd'"),
    "dict of the module": ("a = GAINS", "GAINS"),
    "dict call": ("a = dict(kp=1.0)", "dict"),
    "set of numbers": ("a = set()", "set"),
    "set comprehension": ("a = {each for each in self.z}", "set"),
    "list call": ("a = list(self.z)", "list"),
    "sorted": ("a = sorted(self.z)", "np.sort"),
    "sorted by a key": ("a = max(self.z, key=abs)", "key"),
    "tuple of a generator": ("a = tuple(each > 0.0 for each in self.z)", "generator"),
    "map": ("a = map(abs, self.z)", "map"),
    "deque": ("HISTORY.append(self.f)", "HISTORY"),
    "deque of its own": ("a = deque()", "deque"),
    "f-string": ("name = f'{self.f:.2f}'", "text"),
    "texts added": ("name = 'a' + 'b'\nself.info(name)  # here", "constant text"),
    "f-string in a log": ("self.info(f'f {self.f!r}')", "text"),
    "percent without its value": ("self.info('f %f of %f' % self.f)", "text"),
    "log as logging has it": ("self.info('f %f', self.f)", "place"),
    "log of an array": ("self.info('z {}', self.z)", "array"),
    "log of text": ("name = 'fast'\nself.info('mode {}', name)  # here", "text"),
    "log of None": ("self.info('o {}', self.o)", "None"),
    "log without a text": ("self.info(self.f)", "constant text"),
    "log without arguments": ("self.info()", "constant text"),
    "log by name": ("self.info('f {f}', f=self.f)", "named"),
    "log with too many places": ("self.info('f {} {}', self.f)", "placeholders"),
    "log of an int as a text": ("self.info('n {:s}', self.n)", "{:s}"),
    "logging": ("logging.info('x')", "logging"),
    "logger of the module": ("log.info('x')", "log"),
    "warning of another name": ("self.warning('x')", "warn"),
    "print": ("print(self.f)", "print"),
    "open": ("with open('log.txt', 'a') as file:  # here\n    file.write('x')", "open or lock"),
    "input": ("a = input()", "Input"),
    "time": ("a = time.monotonic()", "clock"),
    "random": ("a = random.gauss(0.0, 1.0)", "replay"),
    "try and except": (
        "try:  # here\n    self.f = 1.0 / self.f\nexcept ZeroDivisionError:\n    self.f = 0.0",
        "caught",
    ),
    "assertion with a text made": ("assert self.f > 0.0, f'{self.f}'", "text"),
    "number raised": ("raise self.f", "not an exception"),
    "exception with a value": ("raise ValueError(self.f)", "constant text"),
    "exception with a text made": ("raise ValueError(f'f is {self.f}')", "text"),
    "global": ("global TOTAL\nTOTAL += 1.0", "TOTAL"),
    "global without its word": ("TOTAL += 1.0", "TOTAL"),
    "del of a variable": ("a = 1.0\ndel a  # here", "deleted"),
    "del of a state": ("del self.f", "deleted"),
    "lambda": ("self.f = (lambda x: 2.0 * x)(self.f)", "call name"),
    "closure": ("def scaled(x):\n    return self.kp * x\n\nself.f = scaled  # here", "call it"),
    "class in a method": ("class Point:  # here\n    x = 1.0", "class in a hook"),
    "import": ("import scipy", "import"),
    "from import": ("from math import sin", "import"),
    "yield": ("yield self.f", "generator"),
    "returned value": ("return self.f", "returns nothing"),
    "with": ("with contextlib.nullcontext():  # here\n    self.n += 1", "open or lock"),
    "star in a call": ("self.f = limited(*self.z)", "*"),
    "two stars in a call": ("self.f = limited(**GAINS)", "**"),
    "star in an assignment": ("a, *b = self.z", "*"),
    "function that takes stars": (
        "def every(*values):  # here\n    return values[0]\n---\nself.f = every(1.0, 2.0)",
        "any number",
    ),
    "function that takes two stars": (
        "def options(**values):  # here\n    return 1.0\n---\nself.f = options(a=1.0)",
        "any number",
    ),
    "recursion": (
        "def again(n):  # here\n    return again(n - 1) if n > 0 else 0\n---\n"
        "self.n = again(self.n)",
        "calls itself",
    ),
    "endless loop": ("while True:  # here\n    self.n += 1", "endless loop"),
    "variable of a branch": ("if self.on:\n    a = 1.0\nself.f = a  # here", "no value"),
    "variable misspelt": ("error = 1.0\nself.f = eror  # here", "eror"),
    "variable read before it is set": ("self.f = a\na = 1.0", "no value"),
    "function before it is set": ("sum = sum(self.z)", "sum"),
    "name that is shadowed": ("abs = abs(self.f)", "abs"),
    "walrus in a comparison": (
        "self.n = self.n + (a := 2) * a * (self.n if self.on else (b := 1))",
        ":=",
    ),
    "match of a sequence": (
        "match self.z:\n    case [a, b]:  # here\n        self.n = 1",
        "pattern",
    ),
    "match of a class": ("match self.f:\n    case float():  # here\n        self.n = 1", "pattern"),
    "match of a dict": ("match self.f:\n    case {'a': 1}:  # here\n        self.n = 1", "pattern"),
    "eval": ("self.f = eval('1.0')", "Python"),
    "getattr": ("self.f = getattr(self, 'kp')", "names"),
    "setattr": ("setattr(self, 'f', 1.0)", "names"),
    "hasattr": ("a = hasattr(self, 'f')", "names"),
    "isinstance": ("a = isinstance(self.f, float)", "types"),
    "vars": ("a = vars(self)", "vars"),
    "id": ("a = id(self.z)", "id"),
    "next": ("a = next(self.z)", "next"),
    "function that counts": (
        "def counter(count):\n    def counted(x):\n        nonlocal count  # here\n"
        "        count += 1\n        return count * x\n\n"
        "    return counted\n\n\ncounted = counter(0)\n---\nself.f = counted(self.f)",
        "nonlocal is not compiled: declare a State",
    ),
    "function with an own decorator": (
        "@wrapped  # here\ndef halved(x):\n    return 0.5 * x\n---\nself.f = halved(self.f)",
        "remove the decorator",
    ),
    "object of a class": ("a = Filter(3.0)", "Filter"),
    "object of the module": ("self.f = FILTER.step(self.f)", "FILTER"),
    "dataclass changed": ("a = Gains(2.0)\na.kp = 3.0  # here", "a.kp is a field of an object"),
    "dataclass set": ("SHARED.kp = 2.0", "SHARED"),
    "own function with too few arguments": ("self.f = limited(self.f)", "limited"),
    "own function with too many arguments": ("self.f = limited(1.0, 2.0, 3.0, 4.0)", "limited"),
    "own function with an unknown name": ("self.f = limited(1.0, 2.0, top=3.0)", "limited"),
    # Members.
    "member misspelt": ("self.f = self.kd", "kd"),
    "member that is not declared": ("self.sum = 0.0", "sum"),
    "member that is not declared, counted": ("self.count += 1", "count"),
    "private member that is not declared": ("self._sum = 0.0", "write `_sum: State[float]`"),
    "member private to the class": ("self.__sum = 0.0", "write `_sum: State[float]`"),
    "method private to the class": ("self.f = self.__sum()", "def __sum(self"),
    "parameter set": ("self.kp = 2.0", "parameter"),
    "element of a parameter set": ("self.gains[0] = 2.0", "parameter"),
    "parameter's value": ("self.f = self.kp.value", "value"),
    "state's value": ("self.f.value = 1.0", "value"),
    "state written": ("self.f.write(1.0)", "write"),
    "input without its value": ("self.f = 2.0 * self.u", "Input"),
    "input written": ("self.u.write(1.0)", "Input"),
    "input's value set": ("self.u.value = 1.0", "Input"),
    "input read": ("self.f = self.u.read()", "read"),
    "input's field misspelt": ("self.on = self.u.is_new", "is_new"),
    "output without write": ("self.y = self.f", "Output"),
    "output's value set": ("self.y.value = self.f", "write"),
    "output written without a value": ("self.y.write()", "one value"),
    "output written with two values": ("self.x.write(1.0, 2.0)", "one value"),
    "output published with a value": ("self.p.publish(1.0)", "takes no arguments"),
    "output sent": ("self.y.send(1.0)", "send"),
    "write as a value": ("a = self.y.write(1.0)", "no value"),
    "queue as a value": ("self.f = self.q", "Queue"),
    "queue's length": ("self.n = len(self.q)", "Queue"),
    "queue in a loop": ("for each in self.q:  # here\n    self.f += each", "Queue"),
    "queue's value": ("self.f = self.q.value", "Queue"),
    "queue popped as a value": ("self.f = self.q.pop()", "front"),
    "queue filled": ("self.q.put(1.0)", "Queue"),
    "derived value set": ("self.d = 1.0", "prepare"),
    "constant of the class set": ("self.LIMIT = 3.0", "LIMIT"),
    "time set": ("self.time = 0", "loop"),
    "time called": ("a = self.time()", "time"),
    "period misspelt": ("self.f = self.Ts", "Ts"),
    "self passed on": ("self.f = limited(self, 1.0)", "self"),
    "self kept": ("me = self", "self"),
    "method without self": ("self.f = helper(self.f)", "helper"),
    "method that is not there": ("self.f = self.helper(self.f)", "helper"),
    "method of the base that is not there": ("super().reset()", "reset"),
    "super without its call": ("super.update()", "super"),
    "update called": ("self.update()", "hook"),
    "fault with a value": ("self.fault('f is {}', self.f)", "constant text"),
    "fault with a text of a list": ("self.fault(NAMES[self.n])", "text"),
    "fault as a value": ("a = self.fault('x')", "statement"),
    # Messages.
    "message's field misspelt": ("self.f = self.t.value.linear.X", "linear.X"),
    "message without its value": ("self.f = self.t.linear.x", "Input"),
    "part of a message as a number": ("self.f = self.t.value.linear", "number"),
    "message of an input set": ("self.t.value.linear.x = 1.0", "Input"),
    "message made": ("a = Twist()", "Twist"),
    "message made and written": ("self.p.write(PoseStamped())", "Output"),
    "message of another type": ("self.p.write(self.t.value)", "Twist"),
    "part of another type": ("self.p.value.pose.position = self.t.value", "Twist"),
    "message added": ("self.f = self.t.value + self.t.value", "number"),
    "message in a list": ("a = [self.t.value]", "number"),
    "text of a message set": ("self.p.value.header.frame_id = 'base'", "text"),
    "text of a message read": ("a = self.p.value.header.frame_id", "text"),
    "time of a message by its parts": ("self.n = self.p.value.header.stamp.secs", "secs"),
    "time of a message set to now": ("self.p.value.header.stamp = rospy.Time.now()", "rospy"),
    "number set to a vector of a message": ("self.p.value.pose.position = self.z", "number"),
    "element of a message's vector": ("self.f = self.t.value.linear[0]", "number"),
    "float to a message's int": ("self.p.value.header.seq = 0.5", "float"),
    "list of as many elements as a state counts": (
        "self.z = [self.kp * i for i in range(self.n)]",
        "shape",
    ),
    "state set to a list of another size": ("self.z = [self.kp * i for i in range(3)]", "(3,)"),
    "rows compared in any": ("self.on = any(row > 0.0 for row in self.m)", "np.any"),
    "comprehension as a loop": ("[self.y.write(each) for each in self.z]", "loop"),
    "variable of a comprehension after it": (
        "self.f = sum(each for each in self.z)\nself.f -= each  # here",
        "each is",
    ),
    "elements counted without enumerate": (
        "for i, each in self.z:  # here\n    self.z[i] = 2.0 * each",
        "enumerate",
    ),
    "port in zip": ("self.f = sum(k * e for k, e in zip(self.gains, self.w))", "self.w.value"),
    "function from a dict by an enum": (
        "LAWS = {Mode.OFF: abs, Mode.RUN: math.sqrt}\n---\nself.f = LAWS[self.mode](self.f)",
        "numbers, tuples or objects as values",
    ),
    "nested function that a function keeps": (
        "def applied(rule, x):\n    kept = rule  # here\n    return kept(x)\n---\n"
        "def double(x):\n    return 2.0 * x\n"
        "\nself.f = applied(double, self.f)",
        "function",
    ),
    "nested function with self": (
        "def scaled(self, x):\n    return self.kp * x\n\nself.f = scaled(self.f)  # here",
        "takes",
    ),
    "nested function called as a method": (
        "def scaled(x):\n    return self.kp * x\n\nself.f = self.scaled(self.f)  # here",
        "write scaled",
    ),
    "nested function that increases a variable of update": (
        "total = 0.0\n\ndef add(x):\n    total += x  # here\n\nadd(self.f)\nself.f = total",
        "return",
    ),
    "function with a handle of MATLAB": (
        "double = @(x) 2.0 * x  # here\nself.f = double(self.f)",
        "syntax",
    ),
    "argument that is given only by name": (
        "def held_at(x, *, top=1.0):\n    return min(x, top)\n---\nself.f = held_at(self.f, 2.0)",
        "top=",
    ),
    "imaginary unit of MATLAB": ("s = 2i * math.pi\nself.f = abs(s)", "syntax"),
    "imaginary unit without its factor": ("self.f = abs(1.0 + 2.0 * j)", "1j"),
    "method of NumPy's complex numbers": (
        "s = 1j * self.f\nself.f = abs(s.conj())  # here",
        "conjugate",
    ),
    "float of a complex number": ("self.f = float(1j * self.f)", ".real"),
    "matrix of zeros as in MATLAB": ("a = np.zeros(2, 2)", "((2, 2))"),
    "largest of two numbers by np.max": ("self.f = np.max(self.f, 0.0)", "np.maximum"),
    "largest of two vectors by max": ("self.z = max(self.z, self.held)", "np.maximum"),
    "vector as the condition of a value": ("a = 1.0 if self.z > 0.0 else 0.0", "np.any"),
    "vector sorted as a value": ("self.z = self.z.sort()", "None"),
    "column minus row": ("self.z[:] = self.z.reshape(2, 1) - self.z", "a matrix"),
    "bounds of another size": (
        "TOP = np.ones(4)\n---\nself.x.write(np.clip(self.w.value, -1.0, TOP))",
        "(4,)",
    ),
    "einsum of too few dimensions": ("a = np.einsum('ij,jk->ik', self.m, self.z)", "einsum"),
    "exchanged arguments of solve": ("self.z[:] = np.linalg.solve(self.z, self.m)", "matri"),
    "exchanged matrices of c2d": (
        "from rtcf.linear import c2d\n---\nad, bd = c2d(B, A, 0.001)",
        "shapes fit",
    ),
    "half of a length as a range": (
        "for i in range(len(self.z) / 2):  # here\n    self.z[i] = 0.0",
        "//",
    ),
    "power as in MATLAB": ("self.f = self.f ^ 2", "**"),
    "enum as in C++": ("self.mode = Mode::RUN", "syntax"),
    "parameter of the class": ("self.f = Faulty.kp", "self.kp"),
    "mode compared with a text": ("if self.mode == 'RUN':  # here\n    self.n = 1", "Mode.RUN"),
    "case of a mode without its enum": (
        "match self.mode:\n    case RUN:  # here\n        self.n = 1\n    case OFF:\n"
        "        self.n = 0",
        "unreachable",
    ),
    "dict by the name of a mode": (
        "SPEEDS = {'OFF': 0.0, 'RUN': 1.0}\n---\nself.f = SPEEDS[self.mode.name]",
        "enum",
    ),
    "input compared with None": ("if self.u.value is None:  # here\n    return", "self.u.valid"),
    "input with an underscore": ("self.f = self._u.value", "self.u"),
    "queue as a condition": (
        "while self.q:  # here\n    self.f += self.q.front\n    self.q.pop()",
        "self.q.size",
    ),
    "front of a queue called": ("self.f = self.q.front()", "front"),
    "update of the base by its name": ("Component.update(self)", "self"),
    "text by a call in a log": ("self.info(f'at {NAMES[int(self.f)]}')", "text"),
    "digits from a state in a log": ("self.info(f'f {self.f:.{self.n}f}')", "log with"),
    "stamped message that is not stamped": ("self.f = self.t.value.twist.linear.x", "angular"),
}

# In the class, before `update`.
CLASS: dict[str, tuple[str, str]] = {
    "text as a state": ("v: State[str]", "str"),
    "list as a state": ("v: State[list]", "list"),
    "list of floats as a state": ("v: State[list[float]]", "list"),
    "dict as a state": ("v: State[dict]", "dict"),
    "array without a size": ("v: State[np.ndarray]", "size"),
    "size in another bracket": ("v: State[np.float64][3]", "two pairs of brackets"),
    "size of 0": ("v: State[np.float64, 0]", "size"),
    "size as a float": ("v: State[np.float64, 2.0]", "size"),
    "four sizes": ("v: State[np.float64, 2, 2, 2, 2]", "one to three sizes"),
    "three sizes of an input": ("v: Input[np.float64, 2, 2, 2]", "at most two"),
    "three sizes of an output": ("v: Output[np.float64, 2, 2, 2]", "at most two"),
    "three sizes of a parameter": ("v: Parameter[np.float64, 2, 2, 2] = 0.0", "at most two"),
    "three sizes of a queue": ("v: Queue[np.float64, 2, 2, 2] = Queue(size=2)", "at most two"),
    "size before the type": ("v: State[3, np.float64]", "size"),
    "complex output": ("v: Output[complex]", "use two floats"),
    "any as a state": ("v: State[Any]", "Any"),
    "enum of texts as a state": ("v: State[Colour]", "Colour"),
    "class as a state": ("v: State[Filter]", "Filter"),
    "dataclass as a state": ("v: State[Gains]", "Gains"),
    "optional port": ("v: Input[float | None]", "None"),
    "plain annotation": ("v: float", "State"),
    "plain annotation with a value": ("v: float = 0.0", "State"),
    "member without an annotation": ("v = State(0.0)", "annotation"),
    "port without an annotation": ("v = Output()", "annotation"),
    "kind without a type": ("v: Input", "type"),
    "kind in parentheses": ("v: State(float)", "State"),
    "text port": (
        "v: Input[String]\n\ndef safe(self):\n    self.n = self.v.value.data  # here",
        "text",
    ),
    "message as a state": ("v: State[Twist]", "Input or an Output"),
    "message as a parameter": ("v: Parameter[Twist] = Parameter(0)", "Input or an Output"),
    "message in a queue": ("v: Queue[Twist] = Queue(size=2)", "Input or an Output"),
    "message without its size": ("v: Input[JointState]", "size"),
    "list of messages": ("v: Output[PoseArray, 3]", "PoseArray"),
    "parameter without a default": ("v: Parameter[float]", "default"),
    "default of another type": ("v: Parameter[int] = Parameter(0.5)", "float"),
    "default as text": ("v: Parameter[float] = Parameter('1.0')", "a float"),
    "default of another size": ("v: Parameter[np.float64, 3] = Parameter([1.0, 2.0])", "(2,)"),
    "default outside its bounds": ("v: Parameter[float] = Parameter(2.0, max=1.0)", "1.0"),
    "default as a keyword": ("v: Parameter[float] = Parameter(default=1.0)", "default"),
    "bounds in the wrong order": ("v: Parameter[float] = Parameter(1.0, min=2.0, max=0.0)", "min"),
    "bound as text": ("v: Parameter[float] = Parameter(1.0, min='0')", "min"),
    "bounds of a state": ("v: State[float] = State(0.0, min=0.0)", "min"),
    "initial value of an input": ("v: Input[float] = Input(1.0)", "initial"),
    "initial value of an output": ("v: Output[float] = 0.0", "initial"),
    "initial value of another size": ("v: State[np.float64, 2] = State(np.zeros(3))", "(3,)"),
    "ragged initial value": ("v: State[np.float64, 2, 2] = State([[1.0], [1.0, 2.0]])", "rows"),
    "None as an initial value": ("v: State[float] = None", "None"),
    "another kind as a value": ("v: State[float] = Output()", "State"),
    "queue without its size": ("v: Queue[float] = Queue()", "size"),
    "queue that is too large": ("v: Queue[float] = Queue(size=5000)", "1024"),
    "unit that is no text": ("v: Output[float] = Output(unit=1)", "unit"),
    "name with two underscores": ("v__w: State[float]", "name"),
    "private input": ("_v: Input[float]", "write v"),
    "private parameter": ("_v: Parameter[float] = 1.0", "write v"),
    "name private to the class": ("__v: State[float]", "write _v"),
    "private name with a letter that ROS has not": ("_ö: State[float]", "write _o"),
    "private name of another state": ("_f: State[float]", "and f are both f outside"),
    "declaration without an annotation, private to the class": (
        "__v = State(0.0)",
        "write `_v: State",
    ),
    "word of every component": ("time: State[float]", "time"),
    "initial value that does not fit": ("v: State[np.uint8] = State(300)", "uint8"),
    "mode that is none": ("v: State[Mode] = State(5)", "Mode"),
    "element name taken": ("gains_0: Parameter[float] = Parameter(1.0)", "gains_0"),
    "size by a variable of another member": ("v: State[np.float64, n]", "n"),
    "dict as a constant": (
        "LIMITS = {'a': 1.0}\n\ndef safe(self):\n    self.f = len(self.LIMITS)  # here",
        "dict",
    ),
    "update with an argument": ("def safe(self, dt):  # here\n    self.f = dt", "self"),
    "start without self": ("def start():  # here\n    pass", "self"),
    "start that is async": ("async def start(self):  # here\n    pass", "async"),
    "start that waits": ("async def start(self):  # here\n    await asyncio.sleep(1)", "async"),
    "hook that is a generator": ("def start(self):\n    yield 1  # here", "generator"),
    "constructor": (
        "def __init__(self):  # here\n    super().__init__()\n    self.k = 1.0",
        "__init__",
    ),
    "class method": (
        "@classmethod\ndef made(cls):\n    return 1\n\n"
        "def start(self):\n    self.n = self.made()  # here",
        "classmethod",
    ),
    "cached property": (
        "@functools.cached_property\ndef k(self):\n    return 1.0\n\n"
        "def start(self):\n    self.f = self.k  # here",
        "cached_property: write @property",
    ),
    "decorated method": (
        "@functools.lru_cache\ndef k(self):\n    return 1.0\n\n"
        "def start(self):\n    self.f = self.k()  # here",
        "remove the decorator",
    ),
    "decorated hook": (
        "@functools.lru_cache\ndef start(self):\n    self.f = 1.0",
        "lru_cache): remove the decorator",
    ),
    "hook compiled by numba": (
        "@numba.njit\ndef start(self):\n    self.f = 1.0",
        "(jit): remove the decorator",
    ),
    "hook with an own decorator": (
        "@timed\ndef start(self):\n    self.f = 1.0",
        "(timed): remove the decorator",
    ),
    "hook with a decorator that wraps it": (
        "@wrapped\ndef start(self):\n    self.f = 1.0",
        "remove the decorator from def start",
    ),
    "hook with a class as its decorator": (
        "@Timed\ndef start(self):\n    self.f = 1.0",
        "(Timed): remove the decorator",
    ),
    "static method compiled by numba": (
        "@staticmethod\n@numba.njit\ndef k(x):\n    return x\n\n"
        "def start(self):\n    self.f = self.k(1.0)  # here",
        "(jit): remove the decorator",
    ),
    "property called": (
        "@property\ndef k(self):\n    return 1.0\n\n"
        "def start(self):\n    self.f = self.k()  # here",
        "k",
    ),
    "property set": (
        "@property\ndef k(self):\n    return 1.0\n\ndef start(self):\n    self.k = 1.0  # here",
        "k is a read-only property: set the members that it is computed from",
    ),
    "property set beside another": (
        "@property\ndef k(self):\n    return self.f\n\n"
        "@k.setter\ndef k(self, x):\n    self.f = x\n\n"
        "def start(self):\n    self.k, self.n = 1.0, 2  # here",
        "k has a setter: write self.k = … on a line of its own",
    ),
    "method without its call": (
        "def k(self):\n    return 1.0\n\ndef start(self):\n    self.f = self.k  # here",
        "call",
    ),
    "method with too few arguments": (
        "def k(self, x):\n    return x\n\ndef start(self):\n    self.f = self.k()  # here",
        "k",
    ),
    "method with too many arguments": (
        "def k(self):\n    return 1.0\n\ndef start(self):\n    self.f = self.k(1.0)  # here",
        "k",
    ),
    "method with a star": (
        "def k(self, *x):  # here\n    return 1.0\n\ndef start(self):\n    self.f = self.k(1.0)",
        "any number",
    ),
    "method with a keyword alone": (
        "def k(self, x=1.0, *, y):  # here\n    return x\n\n"
        "def start(self):\n    self.f = self.k(y=2.0)",
        "give it a default",
    ),
    "method that calls itself": (
        "def k(self, x):\n    return self.k(x)\n\ndef start(self):\n    self.f = self.k(1.0)",
        "itself",
    ),
    "method that returns two types": (
        "def k(self):\n    if self.on:\n        return 1.0\n    return self.z  # here\n\n"
        "def start(self):\n    self.f = self.k()",
        "return",
    ),
    "method that returns nothing": (
        "def k(self):\n    self.n += 1\n\ndef start(self):\n    self.f = self.k()  # here",
        "None",
    ),
    "mutable default": (
        "def k(self, x=[]):  # here\n    return x\n\ndef start(self):\n    self.f = self.k()",
        "shared",
    ),
    "default of a dict": (
        "def k(self, x={}):  # here\n    return 1.0\n\ndef start(self):\n    self.f = self.k()",
        "shared",
    ),
    "input in prepare": ("def prepare(self):\n    self.d = self.u.value  # here", "prepare"),
    "state in prepare": ("def prepare(self):\n    self.f = self.kp  # here", "prepare"),
    "period in prepare": ("def prepare(self):\n    self.d = self.kp * self.dt  # here", "prepare"),
    "output in prepare": ("def prepare(self):\n    self.y.write(1.0)  # here", "prepare"),
    "value returned by start": ("def start(self):\n    return True  # here", "returns"),
    "hook of another class": (
        "update_rate = 10\n\ndef start(self):\n    self.update_rate = 20  # here",
        "constant",
    ),
    "nonlocal": (
        "def start(self):\n    n = 0\n    def more():\n        nonlocal n  # here\n"
        "        n += 1\n    more()",
        "nonlocal",
    ),
    "constant of the class in a comprehension": (
        "SCALE = 2.0\n"
        "v: Parameter[np.float64, 2] = Parameter([SCALE * each for each in (1.0, 2.0)])  # here",
        "SCALE",
    ),
    "type that NumPy removed": ("v: State[np.float, 2]", "np.float64"),
    "name of a type": ("v: State['float']", "use float"),
    "equals in place of a colon": ("v = State[float]", "v: State"),
    "unit without its name": ("v: Output[float] = Output('rad')", "unit="),
    "bounds without their names": ("v: Parameter[float] = Parameter(1.0, 0.0, 9.0)", "min="),
    "initial value of a derived member": ("v: Derived[float] = 0.0", "prepare"),
    "member of an enum as a type": ("v: State[Mode.RUN]", "State[Mode]"),
    "vector or None": ("v: State[np.float64, 2 | None]", "None"),
    "state without its underscore": (
        "_sum: State[float]\n\ndef safe(self):\n    self.sum = 0.0  # here",
        "self._sum",
    ),
    "private name of a parameter outside": (
        "v: Parameter[float] = Parameter(1.0, name='_v')",
        "letter",
    ),
    "method with the name of a state": ("v: State[float]\n\ndef v(self):\n    return 1.0", "State"),
    "static method that uses self": (
        "@staticmethod\ndef k(x):\n    return self.kp * x  # here\n\ndef safe(self):\n"
        "    self.f = self.k(1.0)",
        "staticmethod",
    ),
    "numbers set to bools": (
        "v: State[bool, 2]\n\ndef safe(self):\n    self.v[:] = self.z  # here",
        "bool",
    ),
    "positions of another number of joints": (
        "v: Output[JointState, 2]\n\ndef safe(self):\n"
        "    self.v.value.position[:] = np.zeros(3)  # here",
        "(3,)",
    ),
}

# At the head of the module, before the class.
HEAD: dict[str, tuple[str, str]] = {
    "syntax": ("x = (1.0", "("),
    "colon forgotten": ("if TOTAL == 0.0\n    TOTAL = 1.0", ":"),
    "indent": ("def f():\nreturn 1.0  # here", "indent"),
    "equals in a condition": ("if TOTAL = 0.0:  # here\n    pass", "="),
    "module that is not there": ("import controll", "controll"),
    "module that has another name": ("from rtcf.signal import c2d", "is now rtcf.linear"),
    "name that is not there": ("from rtcf.component import Inputs", "Inputs"),
    "name not imported": ("LIMIT = pi / 2.0", "pi"),
    "division by zero": ("GAIN = 1.0 / TOTAL", "division"),
    "shapes of constants": ("C = A @ B", "sizes 2 and 3"),
    "index of a constant": ("FIRST = TABLE[3]", "range"),
    "file that is not there": ("DATA = np.loadtxt('no_such_table.csv')", "no_such_table"),
    "unknown option": ("OPTION = State(0.0, units='m')", "units"),
    "declaration without brackets": ("SPEED = Input(float)", "annotation"),
    "message that is not there": ("from geometry_msgs.msg import Twists", "Twists"),
    "attribute of NumPy": ("C = np.eyes(2)", "eyes"),
    "two classes of one name": (
        "class Motor(Component):\n    k: State[float]\n\n    def update(self):\n"
        "        self.k = 1.0\n\n\nclass Motor(Component):  # here\n    k: State[int]\n\n"
        "    def update(self):\n        self.k = 1",
        "defined twice",
    ),
    "base classes in the wrong order": (
        "class Base(Component):\n    k: State[float]\n\n\n"
        "class Motor(Component, Base):  # here\n    def update(self):\n        self.k = 1.0",
        "Base",
    ),
    "component as a dataclass": (
        "@dataclass  # here\nclass Motor(Component):\n    k: State[float]\n\n"
        "    def update(self):\n        self.k = 1.0",
        "dataclass",
    ),
    "message from its package": ("from geometry_msgs import Twist", "geometry_msgs.msg"),
    "Component from the client library": ("from rtcf import Component", "rtcf.component"),
}

"""Complex numbers: they mean what Python and NumPy mean."""

from pathlib import Path

import pytest
from rtcf_compile.comparison import verify
from rtcf_compile.machine_code import object_file
from rtcf_compile.source import modules

HEAD = """\
import cmath
import math

import numpy as np
from rtcf.component import Component, Derived, Input, Output, State

PHASES = np.exp(2j * np.pi * np.arange(4) / 4)
J = 1j


def turned(z, angle):
    return z * cmath.rect(1.0, angle)


class Waves(Component):
    u: Input[float]
    n: Input[int]
    v: Input[np.float64, 4]
    y: Output[float]
    w: Output[np.float64, 4]
    phase: State[complex] = 1.0 + 0.5j
    waves: State[np.complex128, 4]
    pairs: State[np.complex128, 2, 2]
    last: State[complex | None]
    turns: Derived[np.complex128, 4]

    def prepare(self):
        self.turns = np.exp(0.5j * np.arange(4))

    def update(self):
        u, v = self.u.value, self.v.value
        z = complex(u, v[0])
"""
WAYS = {
    "constants": "self.y.write(((1 + 2j) * u + J * v[0]).imag + complex(u).real)",
    "division": "self.y.write((z / complex(v[1], v[2])).real)",
    "division by zero": "self.y.write((z / complex(round(v[1]), 0.0)).real)",
    "powers": "self.y.write((z**2).real + (z**3).imag + abs(z**0.5) + (z**-1).real)",
    "power of a variable": "self.y.write((z ** (self.n.value % 5)).real)",
    "power of a complex number": "self.y.write((z ** (0.1 + 0.2j)).imag)",
    "sum and product in place": """
        z += 1j
        z *= 2.0 - 1j
        self.y.write(z.real - z.imag)""",
    "comparison": "self.y.write(1.0 if z == complex(v[0], u) or not z else (-z).imag)",
    "parts": "self.y.write(abs(z) + z.conjugate().imag + np.real(z) - np.imag(z))",
    "polar": """
        r, phi = cmath.polar(z)
        self.y.write(cmath.rect(r, phi).real + cmath.phase(z))""",
    "exp": "self.y.write(cmath.exp(0.01 * z).real)",
    "log": "self.y.write(cmath.log(complex(round(u), round(v[0]))).imag)",
    "roots and angles": """
        self.y.write(cmath.sqrt(z).real + cmath.atan(z).imag + cmath.asinh(z).real)""",
    "trigonometry": "self.y.write(cmath.sin(0.01 * z).real + cmath.tanh(0.01 * z).imag)",
    "float or complex": "x = u if u > 0.0 else 1j * u\n        self.y.write(abs(x))",
    "function": "self.y.write(turned(z, v[1]).real)",
    "goertzel": """
        s = sum(x * cmath.exp(-2j * math.pi * k / 4) for k, x in enumerate(v))
        self.y.write(abs(s))""",
    "array of zeros": """
        a = np.zeros(4, complex)
        a[0] = z
        a[1:] = 2.0
        self.w.write(a.real)""",
    "array of values": """
        a = np.array([z, 1j, u, 2.0])
        a *= 1j
        self.w.write(a.imag)""",
    "array of a comprehension": "self.w.write(np.array([x * J**k for k, x in enumerate(v)]).imag)",
    "functions of arrays": """
        a = np.exp(1j * v) * PHASES
        self.w.write(np.abs(a + 1.0) + np.angle(a) + np.conj(a).imag + a.conj().real)""",
    "sums": """
        a = v * PHASES
        self.y.write(np.sum(a).imag + a.mean().real + np.where(v > 0.0, a, 1j).sum().real)""",
    "products": "self.y.write((v @ PHASES).imag + np.vdot(PHASES, PHASES * u).real)",
    "matrix": "m = np.outer(PHASES, v)\n        self.w.write((m @ PHASES).real + m.T[0].imag)",
    "state": """
        self.phase *= cmath.exp(0.1j)
        self.phase += 0.1 * z
        self.y.write(self.phase.real + abs(self.phase))""",
    "state set to a float": "self.y.write(self.phase.imag)\n        self.phase = u",
    "array of states": """
        self.waves = 0.9 * self.turns * self.waves + z
        self.waves[1] = 2.0
        self.waves[2:] += 1j
        self.pairs[0] = self.waves[:2]
        self.pairs[1, 0] *= 1j
        self.w.write(self.waves.real + np.abs(self.pairs.ravel()))""",
    "old array of states": """
        old = self.waves
        self.waves = self.waves * self.turns + v
        self.w.write((self.waves - old).imag)""",
    "optional state": """
        if self.last is not None:
            self.y.write(abs(z - self.last))
        self.last = z if u > 0.0 else None""",
    "part of an array that changes": """
        a = v + 1j
        part = a.imag
        a *= 2.0
        self.w.write(part)""",
}


@pytest.mark.parametrize("way", WAYS)
def test_complex_numbers_mean_what_python_means(tmp_path: Path, way: str) -> None:
    file = tmp_path / "waves.py"
    file.write_text(f"{HEAD}        {WAYS[way].lstrip()}\n")
    (cls,) = modules.components(modules.load(file))
    result = verify.compare(cls, object_file.compile_component(cls), 300)
    assert result.problem == ""
    assert result.cycles - result.raised > 100

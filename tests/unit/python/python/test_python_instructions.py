"""The compiler computes with the same instructions on every processor."""

import os
import subprocess
import sys
from pathlib import Path

import rtcf_compile

PROGRAM = """
import math
from rtcf_compile import instructions
instructions.choose()
import numpy as np
x = np.sqrt(np.arange(1.0, 65.0))
z = x + 1j / x
print(np.abs(z).tolist() == [math.hypot(each.real, each.imag) for each in z])
print(np.exp(x).tolist() == list(map(math.exp, x)))
"""


# The environment without the settings of the tests themselves.
_PLAIN = {
    name: value
    for name, value in os.environ.items()
    if name not in ("NPY_DISABLE_CPU_FEATURES", "OPENBLAS_CORETYPE")
} | {"PYTHONPATH": str(Path(rtcf_compile.__path__[0]).parent)}


def _said(program: str, **environment: str) -> list[str]:
    done = subprocess.run(
        [sys.executable, "-W", "error::RuntimeWarning", "-c", program],
        env=_PLAIN | environment, capture_output=True, text=True, check=True,
    )  # fmt: skip
    assert done.stderr == ""
    return done.stdout.splitlines()


def test_numpy_has_the_values_of_the_c_library() -> None:
    assert _said(PROGRAM) == ["True", "True"]


def test_what_the_user_has_set_is_kept() -> None:
    program = """
import os
from rtcf_compile import instructions
instructions.choose()
print(os.environ['OPENBLAS_CORETYPE'], os.environ['NPY_DISABLE_CPU_FEATURES'])
"""
    given = {"OPENBLAS_CORETYPE": "Prescott", "NPY_DISABLE_CPU_FEATURES": "AVX512F"}
    assert _said(program, **given) == ["Prescott AVX512F"]


def test_another_processor_needs_nothing(tmp_path: Path) -> None:
    program = f"""
from pathlib import Path

import rtcf_compile
from rtcf_compile import instructions
instructions._CPUINFO = Path({str(tmp_path / "cpuinfo")!r})
environment = {{}}
instructions.choose(environment)
print(environment)
"""
    assert _said(program) == ["{}"]
    (tmp_path / "cpuinfo").write_text("flags : fpu sse2 avx2 avx512f avx512cd\n")
    assert "Haswell" in _said(program)[0]

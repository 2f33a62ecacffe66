"""Lets NumPy use the same instructions on every processor.

With AVX-512, NumPy and OpenBLAS compute complex products, powers, norms and others with other
roundings. A component's results, and the constants in its library, must not depend on the machine
that compiles it.
"""

import os
import sys
from collections.abc import MutableMapping
from importlib import metadata
from pathlib import Path

_FEATURES = "AVX512F AVX512CD AVX512_SKX AVX512_CLX AVX512_CNL AVX512_ICL"
_FEATURES_OF_NUMPY_2 = f"{_FEATURES} AVX512_SPR"
_CPUINFO = Path("/proc/cpuinfo")


def choose(environment: MutableMapping[str, str] = os.environ) -> None:
    """Set the environment for NumPy, before its import; keep the settings of the user."""
    if "numpy" in sys.modules or not _has_avx512():
        return
    is_old = metadata.version("numpy").startswith("1.")  # warns of names that it does not know
    features = _FEATURES if is_old else _FEATURES_OF_NUMPY_2
    environment.setdefault("NPY_DISABLE_CPU_FEATURES", features)
    environment.setdefault("OPENBLAS_CORETYPE", "Haswell")  # has AVX2, as all with AVX-512


def _has_avx512() -> bool:
    try:
        return " avx512f " in _CPUINFO.read_text()
    except OSError:
        return False

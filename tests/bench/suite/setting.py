"""Folders and durations that all benchmarks of one run share.

Created once by `run`, read-only for the benchmarks.
"""

import os
from dataclasses import dataclass
from pathlib import Path

FREQUENCY_HZ = 2000
PRIORITY = 80


@dataclass(frozen=True)
class Setting:
    """The build tree under test and the duration of the long run."""

    build: Path
    output: Path  # folder of results, samples and plots
    hours: float = 0.0  # of the long run of Fig. 1; 0 = the short run

    @property
    def library(self) -> Path:
        """Return the library of Mimo."""
        return self.build / "lib/rtcf/rtcf_examples/rtcf_examples.so"

    def program(self, name: str) -> str:
        """Return the path of a benchmark program."""
        return str(self.build / "bench/bin" / f"bench_{name}")

    @property
    def cpu(self) -> int:
        """Return the CPU of real-time threads: the last one, as rtcf and HAL choose."""
        return max(os.sched_getaffinity(0))

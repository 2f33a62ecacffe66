"""What all benches of one run share: where things are, and how long to measure.

Made once by `run`; benches only read it.
"""

import os
from dataclasses import dataclass
from pathlib import Path

FREQUENCY_HZ = 2000
PRIORITY = 80


@dataclass(frozen=True)
class Setting:
    """The build tree under test and the time there is."""

    build: Path
    output: Path  # folder of results, samples and plots
    hours: float = 0.0  # of the long run of Fig. 1; 0 = the short run

    @property
    def library(self) -> Path:
        """Return the library that Mimo is in."""
        return self.build / "lib/rtcf/rtcf_examples/rtcf_examples.so"

    def program(self, name: str) -> str:
        """Return the path of one of the benches' programs."""
        return str(self.build / "bench/bin" / f"bench_{name}")

    @property
    def cpu(self) -> int:
        """Return the CPU of real-time threads: the last one, as rtcf and HAL choose."""
        return max(os.sched_getaffinity(0))

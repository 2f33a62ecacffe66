"""Statistics of the last hundred values (mean, deviation, extremes, median) and a finite impulse
response filter over the last eight.
"""

import numpy as np
from rtcf.component import Component, Input, Output, State

SIZE, TAPS = 100, 8
WINDOW = np.hanning(TAPS + 2)[1:-1] / np.sum(np.hanning(TAPS + 2))


class RingBuffer(Component):
    """Computes statistics of the last values of a signal."""

    u: Input[float]
    mean: Output[float]
    deviation: Output[float]
    span: Output[np.float64, 2]
    median: Output[float]
    smooth: Output[float]
    peak: Output[int]

    values: State[np.float64, SIZE]
    taps: State[np.float64, TAPS]
    count: State[int]

    def update(self):
        if not self.u.new:
            return
        self.values[self.count % SIZE] = self.u.value
        self.count += 1
        self.taps[1:] = self.taps[:-1]
        self.taps[0] = self.u.value

        known = self.values[: min(self.count, SIZE)]
        self.mean.write(np.mean(known))
        self.deviation.write(np.std(known))
        self.span.write(np.array([np.min(known), np.max(known)]))
        ordered = np.sort(known)
        half = len(known) // 2
        if len(known) % 2:
            self.median.write(ordered[half])
        else:
            self.median.write((ordered[half - 1] + ordered[half]) / 2.0)
        self.smooth.write(WINDOW @ self.taps)
        self.peak.write(np.argmax(np.abs(known)))

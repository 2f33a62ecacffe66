"""An executor's memory shared with rtcfd, opened as by rtcfd: it outlives the process."""

import os
from pathlib import Path

from rtcfd.executor.flight_recorder import FlightRecorder


class SharedMemory:
    """Frames and flight recorder of one executor."""

    def __init__(self, pid: int) -> None:
        links = {each.name: os.readlink(each) for each in Path(f"/proc/{pid}/fd").iterdir()}

        def number(name: str) -> int:
            return int(next(fd for fd, target in links.items() if f"memfd:{name}" in target))

        self.frames = os.open(f"/proc/{pid}/fd/{number('rtcf-frames')}", os.O_RDONLY)
        self.recorder = FlightRecorder(pid, number("rtcf-flight-recorder"))

    def close(self) -> None:
        """Close both."""
        os.close(self.frames)
        self.recorder.close()

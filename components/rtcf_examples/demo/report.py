"""Reports of a ROS node of the demo to its parent process: one line of JSON on standard
output, several times a second, and a last line when the node shuts down."""

import json
import math
import os
import sys
import time
from collections.abc import Callable
from typing import Any

import rospy

_PERIOD_S = 0.1


class Report:
    """Counts the messages that a node receives and sends, and prints the counts."""

    def __init__(self) -> None:
        self.newest: float | None = None
        self.sent = 0
        self._received = 0
        self._not_finite = 0

    def take(self, message: Any) -> None:
        """Count a std_msgs/Float64; called by rospy, in the order of arrival."""
        self._received += 1
        if math.isfinite(message.data):
            self.newest = message.data
        else:
            self._not_finite += 1

    def run(self, connected: Callable[[], bool]) -> None:
        """Report until the node shuts down or the parent stops reading."""
        try:
            while not rospy.is_shutdown():
                self._print(connected())
                time.sleep(_PERIOD_S)
            self._print(False)
        except BrokenPipeError:
            # The parent is gone. Flushing the rest of the buffer at exit would raise again.
            os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())

    def _print(self, connected: bool) -> None:
        counts = {
            "connected": connected,
            "received": self._received,
            "not_finite": self._not_finite,
            "newest": self.newest,
            "sent": self.sent,
        }
        print(json.dumps(counts), flush=True)

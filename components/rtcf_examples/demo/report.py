"""What a ROS node of the demo tells its parent: a line of JSON on standard output,
several times a second, and a last one when the node is shut down."""

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
    """What a node has received and sent."""

    def __init__(self) -> None:
        self.newest: float | None = None
        self.sent = 0
        self._received = 0
        self._not_finite = 0

    def take(self, message: Any) -> None:
        """Take a std_msgs/Float64; called by rospy, in its order."""
        self._received += 1
        if math.isfinite(message.data):
            self.newest = message.data
        else:
            self._not_finite += 1

    def run(self, connected: Callable[[], bool]) -> None:
        """Report until the node is shut down or nobody reads."""
        try:
            while not rospy.is_shutdown():
                self._print(connected())
                time.sleep(_PERIOD_S)
            self._print(False)
        except BrokenPipeError:
            # The parent is gone; what is left in the buffer would only raise again at exit.
            os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())

    def _print(self, connected: bool) -> None:
        figures = {
            "connected": connected,
            "received": self._received,
            "not_finite": self._not_finite,
            "newest": self.newest,
            "sent": self.sent,
        }
        print(json.dumps(figures), flush=True)

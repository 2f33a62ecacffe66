"""Exit statuses of rt_runner and rt_launcher, for roslaunch's `required` and `respawn`."""

from enum import IntEnum


class Code(IntEnum):
    """The reason for the end of the process."""

    DONE = 0  # ended on request
    REFUSED = 1  # an error of rtcfd or the machine; nothing is loaded
    USAGE = 2  # invalid arguments or parameters
    FAILED = 3  # the component failed or was taken out; the loop ended by a fault
    LOST = 4  # the runner or rtcfd ended


class Ending(Exception):
    """Ends the process: one line for people, and the status."""

    def __init__(self, code: Code, message: str = "") -> None:
        super().__init__(" ".join(message.split()))
        self.code = code

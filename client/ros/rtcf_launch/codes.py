"""Exit statuses of rt_runner and rt_launcher; roslaunch's `required` and `respawn` build on
them."""

from enum import IntEnum


class Code(IntEnum):
    """Why the process has ended."""

    DONE = 0  # it was asked to end
    REFUSED = 1  # rtcfd or the machine refused; nothing is loaded
    USAGE = 2  # wrong arguments or parameters
    FAILED = 3  # the component failed or was taken out; the loop ended by a fault
    LOST = 4  # the runner or rtcfd has gone


class Ending(Exception):
    """Ends the process: one line for people, and the status."""

    def __init__(self, code: Code, message: str = "") -> None:
        super().__init__(" ".join(message.split()))
        self.code = code

"""Which runner a launcher loads into: the one that it names, else the nearest rt_runner, else the
only runner of the launch.  Only runners that live count: parameters of others may be left over."""

import os
import time

from rtcf_launch import arguments, rendezvous
from rtcf_launch.codes import Code, Ending
from rtcf_launch.master import Master
from rtcf_launch.rendezvous import Meeting

# roslaunch has set the parameters of all nodes before it starts any: so long a runner that has
# some may need to come to life.
_GRACE_S = 5.0
# So long a runner of any other name may need to say that it is there.
_SETTLE_S = 2.0


class RunnerChoice:
    """Asked again and again until it knows one; `waiting` then says what is missing."""

    def __init__(self, master: Master, ns: str, named: str | None) -> None:
        self._master = master
        self._ns = ns
        self._named = named
        self._begin = time.monotonic()
        self.waiting = ""

    def look(self) -> Meeting | None:
        """Return a runner that can be used.  Raises Ending if waiting is no use."""
        if self._named is not None:
            return self._of(arguments.resolve(self._named, self._ns))
        passed = time.monotonic() - self._begin
        near = arguments.upward("rt_runner", self._ns)
        for node in near:
            if not self._master.has(node):
                continue
            found = self._of(node)
            if found is not None or self._is_starting(node) or passed < _GRACE_S:
                return found
        if passed < _SETTLE_S:
            self.waiting = f"runner {near[0]}"
            return None
        return self._only_one(near[0])

    def _of(self, node: str) -> Meeting | None:
        meeting = rendezvous.find(self._master, node)
        if meeting is not None and meeting.host != rendezvous.host():
            raise Ending(
                Code.REFUSED,
                f"runner {node} is on {meeting.host}, this launcher on {rendezvous.host()}: "
                "start both on one machine",
            )
        if meeting is not None and rendezvous.alive(meeting):
            self.waiting = f"runner {node}, which starts"
            return None if meeting.starting else meeting
        left_over = self._master.has(node)
        what = "its parameters are there, it is not" if left_over else "there is none of that name"
        self.waiting = f"runner {node}: {what}{self._others()}"
        return None

    def _is_starting(self, node: str) -> bool:
        meeting = rendezvous.find(self._master, node)
        return meeting is not None and meeting.starting and rendezvous.alive(meeting)

    def _only_one(self, nearest: str) -> Meeting | None:
        there = self._living()
        ours = {
            node: each for node, each in there.items() if each.launch == str(os.getppid())
        } or there
        if len(ours) > 1:
            raise Ending(
                Code.USAGE, f"which runner? There are {', '.join(ours)}: name one by ~runner"
            )
        if not ours:
            self.waiting = f"runner {nearest}: no rt_runner runs at this ROS master"
            return None
        ((node, meeting),) = ours.items()
        self.waiting = f"runner {node}, which starts"
        return None if meeting.starting else meeting

    def _living(self) -> dict[str, Meeting]:
        found = {
            node: rendezvous.find(self._master, node) for node in rendezvous.nodes(self._master)
        }
        return {
            node: each
            for node, each in found.items()
            if each is not None and each.host == rendezvous.host() and rendezvous.alive(each)
        }

    def _others(self) -> str:
        there = ", ".join(self._living())
        return f" (there are: {there}; ~runner names another)" if there else ""

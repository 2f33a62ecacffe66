"""The runner that a launcher loads into: the named one, else the nearest rt_runner, else the only
runner of the launch.  Only running runners count, because a dead runner may leave its entry."""

import os
import time

from rtcf_launch import arguments, runner_entry
from rtcf_launch.codes import Code, Ending
from rtcf_launch.master import Master
from rtcf_launch.runner_entry import RunnerEntry

# Longest wait for a runner that has parameters to start: roslaunch sets the parameters of all nodes
# before it starts the first one.
_GRACE_S = 5.0
# Longest wait for a runner of another name to write its entry.
_SETTLE_S = 2.0


class RunnerChoice:
    """The choice of a runner, polled until there is one; `waiting` describes the missing one."""

    def __init__(self, master: Master, ns: str, named: str | None) -> None:
        self._master = master
        self._ns = ns
        self._named = named
        self._begin = time.monotonic()
        self.waiting = ""

    def poll(self) -> RunnerEntry | None:
        """Return a ready runner, or None.  Raises Ending if waiting cannot help."""
        if self._named is not None:
            return self._runner_of(arguments.resolve(self._named, self._ns))
        passed = time.monotonic() - self._begin
        near = arguments.upward("rt_runner", self._ns)
        for node in near:
            if not self._master.has(node):
                continue
            found = self._runner_of(node)
            if found is not None or self._is_starting(node) or passed < _GRACE_S:
                return found
        if passed < _SETTLE_S:
            self.waiting = f"runner {near[0]}"
            return None
        return self._only_one(near[0])

    def _runner_of(self, node: str) -> RunnerEntry | None:
        entry = runner_entry.find(self._master, node)
        if entry is not None and entry.host != runner_entry.host():
            raise Ending(
                Code.REFUSED,
                f"runner {node} is on {entry.host}, this launcher on {runner_entry.host()}: "
                "start both on one machine",
            )
        if entry is not None and runner_entry.alive(entry):
            self.waiting = f"runner {node}, which starts"
            return None if entry.starting else entry
        left_over = self._master.has(node)
        what = "it has parameters but does not run" if left_over else "there is no such runner"
        self.waiting = f"runner {node}: {what}{self._others()}"
        return None

    def _is_starting(self, node: str) -> bool:
        entry = runner_entry.find(self._master, node)
        return entry is not None and entry.starting and runner_entry.alive(entry)

    def _only_one(self, nearest: str) -> RunnerEntry | None:
        there = self._living_runners()
        ours = {
            node: each for node, each in there.items() if each.launch == str(os.getppid())
        } or there
        if len(ours) > 1:
            raise Ending(
                Code.USAGE, f"several runners run: {', '.join(ours)}: select one with ~runner"
            )
        if not ours:
            self.waiting = f"runner {nearest}: no rt_runner runs at this ROS master"
            return None
        ((node, entry),) = ours.items()
        self.waiting = f"runner {node}, which starts"
        return None if entry.starting else entry

    def _living_runners(self) -> dict[str, RunnerEntry]:
        found = {
            node: runner_entry.find(self._master, node) for node in runner_entry.nodes(self._master)
        }
        return {
            node: each
            for node, each in found.items()
            if each is not None and each.host == runner_entry.host() and runner_entry.alive(each)
        }

    def _others(self) -> str:
        there = ", ".join(self._living_runners())
        return f" (running: {there}; select one with ~runner)" if there else ""

"""Downtime of a runner whose executor dies."""

import os
import signal
import time

from graphs import paper
from quantiles import median
from result import Budget, Result
from setting import Setting

from daemon import Daemon

_ROUNDS = 3  # after more crashes within a minute rtcfd holds the runner
_DEADLINE_S = 30.0


def run(setting: Setting) -> Result:
    """Kill the executor and wait for its successor with the same graph."""
    result = Result("restart", "from the killed executor to a new one with its graph", ["run", "s"])
    with Daemon(setting) as daemon:
        for component in paper():
            daemon.client.load(component)
        daemon.client.start()
        times = []
        for number in range(_ROUNDS):
            before = daemon.executor
            begin = time.monotonic()
            os.kill(before, signal.SIGKILL)
            while not _restored(daemon, before):
                if time.monotonic() - begin > _DEADLINE_S:
                    result.skipped = "the graph is not restored"
                    return result
                time.sleep(0.005)
            times.append(time.monotonic() - begin)
            result.rows.append([f"{number + 1}", times[-1]])
    result.budgets = [Budget("crash to the executor back with its graph", median(times), 1.0, "s")]
    return result


def _restored(daemon: Daemon, before: int) -> bool:
    runner = daemon.client.get_status().runners[0]
    return runner.pid not in (0, before) and runner.components == len(paper())

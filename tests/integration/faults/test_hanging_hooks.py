"""Hooks that hang at random: the operator gets rid of each by a command that a message names, and
no component, value or setting of others is lost.

Compared with a model of the graph.  `RTCF_SEED` selects other hangs.
"""

import os
import random
import re
import shlex
import signal
import threading
from collections import Counter
from collections.abc import Iterator
from pathlib import Path

import pytest
import rtcf
from daemon_process import NO_ROS, Daemon, is_gone, wait_for
from rtcf.v1 import graph_pb2, runner_pb2
from values import state

TIMEOUT_S = 1.0
SETTINGS = (
    f"[runner]\nhook_timeout_s = {TIMEOUT_S}\non_boot = 'resume'\norphan_timeout_s = 60.0\n{NO_ROS}"
)
SEED = int(os.environ.get("RTCF_SEED", "2021"))
RUNNER = "rt_runner"
# In the answer to a stop of a loop that had no processor for the time of a hook.
AT_EXECUTOR = "the loop was stopped at its executor"
NAMES = ["a", "b", "c", "d"]
NEW = ["constructor", "prepare", "configure"]
OLD = ["cleanup", "destructor"]
# By command: the hooks that may hang in a stopped loop, and those that may in a running one.
OCCASIONS: dict[str, tuple[list[str], list[str]]] = {
    "load": (NEW, [*NEW, "start"]),
    "replace": (NEW + OLD, [*NEW, "start", "stop", *OLD]),
    "unload": (OLD, ["stop", *OLD]),
    "apply": (OLD, ["stop", *OLD]),
    "set": (["prepare"], ["prepare"]),
    "start": (["start"], []),
    "stop": ([], ["stop"]),
    "restart": (NEW + OLD, [*NEW, "stop", *OLD]),
    "boot": (NEW, [*NEW, "start"]),
}


class Operator:
    """Lets hooks hang, follows the messages, and compares the graph with that of the model."""

    def __init__(self, daemon: Daemon, hangs: Path, seed: int) -> None:
        self.daemon = daemon
        self.hangs = hangs
        self.draw = random.Random(seed)
        self.gains: dict[str, float] = {}  # by component of the graph
        self.frequency_hz = 200.0
        self.running = False
        self.seen: Counter[tuple[str, str]] = Counter()
        self.history: list[str] = []

    # -- commands ---------------------------------------------------------------

    def ctl(self, *words: str) -> str:
        """Run rtcfctl; return its output."""
        done = self.daemon.ctl(*words)
        said = done.stdout + done.stderr
        self.history.append(f"$ rtcfctl {shlex.join(words)}\n{said}({done.returncode})")
        return said

    def must(self, *words: str) -> str:
        """Run rtcfctl, which must succeed."""
        said = self.ctl(*words)
        assert self.history[-1].endswith("(0)"), self.story()
        return said

    def story(self) -> str:
        """Return the last commands and answers, for messages."""
        return "\n".join(self.history[-12:])

    def expect(self, condition: object, what: str) -> None:
        """Fail with the last commands if a condition is not true."""
        assert condition, f"{what}\n{self.story()}"

    # -- the model ----------------------------------------------------------------

    def compare(self) -> None:
        """Compare graph, values, settings and loop with the model."""
        with rtcf.Client(self.daemon.socket) as client:
            status = state(client)
            found = {
                each.spec.name: next(p.value.double_value for p in each.parameters
                                     if p.name == "gain")
                for each in client.list_components()
                if each.spec.type == "Hangs" and each.library
            }  # fmt: skip
            others = [each.full_name for each in client.list_components() if each.library]
        self.expect(found == self.gains, f"{found} is not {self.gains}")
        self.expect("/steady" in others, "the other component has gone")
        self.expect(status.settings.frequency_hz == self.frequency_hz, "a setting is lost")
        wanted = runner_pb2.RUNNER_STATE_RUNNING if self.running else None
        self.expect(wanted in (None, status.state), "the loop does not run")
        self.expect(status.state != runner_pb2.RUNNER_STATE_STUCK, "the runner is stuck")

    def calm(self) -> None:
        """Change something without a hang, so that each hang meets another state."""
        free = [name for name in NAMES if name not in self.gains]
        if len(self.gains) < 2 or (free and self.draw.random() < 0.5):
            name, gain = self.draw.choice(free), float(self.draw.randrange(100))
            self.must("load", "rtcf_faults", "Hangs", "--name", name, "--param", f"gain:={gain}")
            self.gains[name] = gain
        name, gain = self.draw.choice(sorted(self.gains)), float(self.draw.randrange(100))
        self.must("set", name, f"gain:={gain}")
        self.gains[name] = gain
        if self.draw.random() < 0.2:
            self.frequency_hz = float(self.draw.randrange(100, 300))
            self.must("runner", "set", RUNNER, "--frequency", f"{self.frequency_hz:g}")
        if self.draw.random() < 0.6 and not self.running:
            self.must("start")
            self.running = True
        elif self.draw.random() < 0.2 and self.running:
            self.must("stop")
            self.running = False

    # -- hangs --------------------------------------------------------------------

    def round(self) -> None:
        """Let one hook hang, get rid of it, and compare."""
        self.calm()
        free = [name for name in NAMES if name not in self.gains]
        possible = [
            (command, hook)
            for command, hooks in OCCASIONS.items()
            for hook in hooks[self.running]
            if free or command != "load"
        ]
        rarest = min(self.seen[each] for each in possible)
        command, hook = self.draw.choice([each for each in possible if self.seen[each] == rarest])
        name = self.draw.choice(free if command == "load" else sorted(self.gains))
        file = self.hangs / f"{name}.{hook}"
        self.history.append(f"# {command}: /{name}.{hook}() hangs")
        file.touch()
        said = self.hang(command, name, hook)
        self.expect(file.stat().st_size, "the hook was not called")
        self.seen[command, hook] += 1
        if self.draw.random() < 0.15:
            self.restart_rtcfd()
            said = ""
        self.get_rid(said, name, file)
        file.unlink(missing_ok=True)
        self.compare()

    def hang(self, command: str, name: str, hook: str) -> str:
        """Run a command in which a hook hangs; return its answer. Follows in the model."""
        stuck = f"stuck in /{name}.{hook}()"
        if command in ("restart", "boot"):
            begin = len(self.daemon.log())
            self.ctl("runner", "restart", RUNNER) if command == "restart" else self.boot()
            self.running = False
            if hook in ("stop", *OLD):
                # The executor has ended, and its components with it.
                self.expect(f"/{name}.{hook}()" in self.daemon.log()[begin:], "the log")
                return ""
            said = self.ctl("status")
            self.expect(f"/{name} is left out: its {hook}() did not return" in said, "the status")
            return said
        gain = self.gains.get(name, 0.0)
        words = {
            "load": ["load", "rtcf_faults", "Hangs", "--name", name],
            "replace": ["replace", name, "rtcf_faults", "Hangs", "--param", f"gain:={gain + 1}"],
            "unload": ["unload", name],
            "apply": ["apply", str(self.graph_without(name))] if command == "apply" else [],
            "set": ["set", name, f"gain:={gain + 1}"],
            "start": ["start"],
            "stop": ["stop"],
        }[command]
        said = self.ctl(*words)
        self.expect(stuck in said, "the answer")
        adopted = self.history[-1].endswith("(0)")
        complete = hook in ("stop", *OLD) and command != "stop"
        self.expect(adopted == complete or AT_EXECUTOR in said, "the exit status")
        if adopted and command == "replace":
            self.gains[name] = gain + 1
        elif adopted:
            del self.gains[name]
        if command == "stop":
            self.running = False
        with rtcf.Client(self.daemon.socket) as client:
            row = [each for each in client.list_components() if each.full_name == f"/{name}"][-1]
            self.expect(row.state == graph_pb2.COMPONENT_STATE_STUCK, "list")
            self.expect(f"its {hook}() has not returned" in row.fault, "list")
            loop_runs = client.get_statistics().iterations
            if self.running:
                wait_for(lambda: client.get_statistics().iterations > loop_runs, "cycles")
        return said

    def graph_without(self, name: str) -> Path:
        """Write the present graph without a component to a file."""
        with rtcf.Client(self.daemon.socket) as client:
            specs = [
                rtcf.live_spec(each) for each in client.list_components() if each.spec.name != name
            ]
        file = self.hangs / "graph.yaml"
        file.write_text(rtcf.write_graphs([rtcf.Graph(RUNNER, components=specs)]))
        return file

    def boot(self) -> None:
        """Restart rtcfd after a loss of power."""
        with rtcf.Client(self.daemon.socket) as client:
            pid = state(client).pid
        self.daemon.end(signal.SIGKILL)
        os.kill(pid, signal.SIGKILL)
        wait_for(lambda: is_gone(pid), "the end of the executor")
        self.history.append("# loss of power")
        self.daemon.start()

    def restart_rtcfd(self) -> None:
        """Let rtcfd crash and start again, beside its executors."""
        self.history.append("# rtcfd crashes")
        self.daemon.end(signal.SIGKILL)
        self.daemon.start()

    def get_rid(self, said: str, name: str, file: Path) -> None:
        """Follow the messages until no hook hangs and no component is left out."""
        for _ in range(4):
            with rtcf.Client(self.daemon.socket) as client:
                stuck = state(client).state == runner_pb2.RUNNER_STATE_STUCK
                out = [
                    each.spec.name
                    for each in client.list_components()
                    if each.state == graph_pb2.COMPONENT_STATE_LEFT_OUT
                ]
            if not stuck and not out:
                return
            self.expect(set(out) <= {name}, "another component is left out")
            if not said:
                said = self.ctl("status")
            found = re.findall(r"`rtcfctl ([^`]+)`", said)
            verbs = ("restart", "unload") if stuck else ("release", "unload", "start --without")
            chosen = [each for each in found if any(verb in each for verb in verbs)]
            self.expect(chosen, "no message names a command")
            command = self.draw.choice(chosen)
            if "release" in command or self.draw.random() < 0.5:
                file.unlink(missing_ok=True)
            if "unload" in command and name in self.gains:
                del self.gains[name]
            if stuck or "start" in command:
                self.running = "start" in command and not stuck
            self.must(*shlex.split(command))
            said = ""
        self.expect(False, "the commands do not help")


@pytest.fixture
def operator(tmp_path: Path) -> Iterator[Operator]:
    """Yield an operator of a graph with one component that never hangs, beside another loop."""
    hangs = tmp_path / "hangs"
    hangs.mkdir()
    daemon = Daemon(tmp_path, SETTINGS, environment={"RTCF_TEST_HANGS": str(hangs)})
    daemon.start()
    operator = Operator(daemon, hangs, SEED)
    operator.must("runner", "set", RUNNER, "--frequency", "200")
    operator.must("load", "rtcf_test", "Counter", "--name", "steady")
    operator.must("runner", "add", "other", "--frequency", "100")
    operator.must("-r", "other", "load", "rtcf_test", "Counter", "--name", "other")
    operator.must("-r", "other", "start")
    with rtcf.Client(daemon.socket) as client:
        pid = client.get_status("other").runners[0].pid
    yield operator
    with rtcf.Client(daemon.socket) as client:
        (other,) = client.get_status("other").runners
        assert (other.pid, other.state) == (pid, runner_pb2.RUNNER_STATE_RUNNING)
    daemon.end()


def test_a_stop_names_the_hook_that_keeps_components_from_stopping(operator: Operator) -> None:
    operator.must("start")
    (operator.hangs / "a.configure").touch()
    operator.ctl("load", "rtcf_faults", "Hangs", "--name", "a")
    assert "/a\n  stuck: its configure() has not returned for" in operator.must("info", "a")
    done = operator.daemon.ctl("stop")
    assert "runner rt_runner is stuck in /a.configure()" in done.stderr
    if AT_EXECUTOR not in done.stderr:
        assert done.returncode == 1 and "the loop has ended, but" in done.stderr
    assert len(done.stderr.splitlines()) == 1
    with rtcf.Client(operator.daemon.socket) as client:
        assert "`rtcfctl runner restart rt_runner` ends this hook" in state(client).status
    operator.must("runner", "restart", RUNNER)
    operator.must("start")


def test_a_forced_unload_ends_the_loop_only_if_a_hook_hangs(operator: Operator) -> None:
    for name in ("a", "b"):
        operator.must("load", "rtcf_faults", "Hangs", "--name", name)
    operator.must("start")
    operator.must("unload", "--force", "a")
    with rtcf.Client(operator.daemon.socket) as client:
        assert state(client).state == runner_pb2.RUNNER_STATE_RUNNING
        pid = state(client).pid
        (operator.hangs / "b.cleanup").touch()
        said = operator.must("unload", "--force", "b")
        assert "as /b.cleanup() did not return" in said
        assert "`rtcfctl -r rt_runner start` starts it" in said
        assert state(client).state == runner_pb2.RUNNER_STATE_STOPPED
        assert state(client).pid != pid
        assert client.get_order() == ["/steady"]
        assert "b" not in [each.spec.name for each in client.list_components()]


def test_the_graph_survives_an_rtcfd_that_dies_while_a_restored_component_hangs(
    operator: Operator,
) -> None:
    for name in ("a", "b"):
        operator.must("load", "rtcf_faults", "Hangs", "--name", name)
    file = operator.hangs / "a.configure"
    file.touch()
    with rtcf.Client(operator.daemon.socket) as client:
        asked = threading.Thread(target=lambda: operator.ctl("runner", "restart", RUNNER))
        asked.start()
        wait_for(lambda: file.stat().st_size, "the hook")
        pid = state(client).pid
        operator.daemon.end(signal.SIGKILL)
        asked.join()
    file.unlink()
    operator.daemon.start()
    with rtcf.Client(operator.daemon.socket) as client:
        status = state(client)
        assert status.pid != pid
        assert "/a is left out: its configure() did not return" in status.status
        assert sorted(client.get_order()) == ["/b", "/steady"]
        client.release(["a"])
        assert sorted(client.get_order()) == ["/a", "/b", "/steady"]


def test_hooks_that_hang_lose_nothing_of_others(operator: Operator) -> None:
    for _ in range(24):
        operator.round()
    assert len(operator.seen) > 18, operator.seen


@pytest.mark.long
def test_a_thousand_hooks_that_hang_lose_nothing_of_others(operator: Operator) -> None:
    for _ in range(1000):
        operator.round()
    every = {(name, hook) for name, hooks in OCCASIONS.items() for hook in (*hooks[0], *hooks[1])}
    assert set(operator.seen) == every

"""Random operations of careless clients on several runners: rtcfd always agrees with a model.

The operations: changes with batches and vectors, undo, replacements with parameters, graph files of
several runners, leases whose holders have odd names, hooks that hang, damaged files, restarts and
kills of rtcfd and of executors, also in the middle of a change.  `RTCF_SEED` selects others.
"""

import copy
import itertools
import json
import os
import random
import signal
import threading
import time
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from typing import Any

import daemon_model
import pytest
import rtcf
import yaml
from daemon_model import Change, Rejected, Runner, Value, Values, Wanted
from daemon_process import Daemon, wait_for
from rtcf.v1 import control_pb2, graph_pb2, runner_pb2

SEED = int(os.environ.get("RTCF_SEED", "50"))
NAMES = {"/k": "Knobs", "/n/k": "Knobs", "/w": "Weights", "/n/w": "Weights"}
RUNNERS = ["rt_runner", "arm", "leg"]
LONGEST_DELAY_S = 0.03  # before a kill in the middle of a change
LONG = range(15, 201)  # changes of a component that rtcfd keeps, some of them undone
Contents = dict[str, tuple[str, Values]]  # type and values by full name
ODD_NAMES = ["ann", "", " ", "\x1b[31mred", "a\nb", "\u202egnirts", "ü" * 255, "\x9b2J", "%s{}"]


@pytest.fixture
def settings() -> str:
    """Return settings of an rtcfd whose executors outlive it."""
    return "[runner]\norphan_timeout_s = 60\n[runner.ros]\nenabled = false\n"


class Clients:
    """Makes random operations, each on rtcfd and on the model."""

    def __init__(self, daemon: Daemon, seed: int) -> None:
        self.daemon = daemon
        self.random = random.Random(seed)
        self.model: dict[str, Runner] = {"rt_runner": Runner()}
        self.client = rtcf.Client(daemon.socket)
        self.done: Counter[str] = Counter()
        self.rejected = 0
        self.files = 0
        self._garbage: set[Path] = set()

    def round(self) -> None:
        """Make one operation and compare."""
        kinds: dict[Callable[[], None], int] = {
            self.load: 16, self.set_some: 30, self.undo: 16, self.replace: 12, self.unload: 6,
            self.apply: 8, self.apply_file: 3, self.remove: 1, self.run_loop: 2,
            self.interrupt: 2, self.kill: 1, self.restart: 1, self.lease: 2, self.hang: 1,
            self.damage: 1,
        }  # fmt: skip
        (kind,) = self.random.choices(list(kinds), list(kinds.values()))
        kind()
        self.done[kind.__name__] += 1
        self.compare()

    # Draws

    def _runner(self) -> str:
        return self.random.choice(sorted(self.model))

    def _there(self, runner: str) -> str:
        """Return the name of a component, which exists in most cases."""
        there = sorted(self.model[runner].components)
        return self.random.choice(there if there and self.random.random() < 0.9 else sorted(NAMES))

    def _values(self, kind: str, most: int) -> Values:
        """Return some values of parameters, rarely invalid."""
        draw = self.random
        values: Values = {}
        if kind == "Weights" and draw.random() < 0.5:  # a whole list
            size = draw.randint(1, daemon_model.ELEMENTS)
            values[daemon_model.SIZE] = size
            values |= {f"filter/taps_{k}": float(draw.randint(-9, 9)) for k in range(size)}
        else:
            names = list(daemon_model.DEFAULTS[kind])
            for name in draw.sample(names, min(len(names), draw.randint(1, most))):
                values[name] = self._value(name)
        if draw.random() < 0.1:
            name = draw.choice(list(values))
            bad: dict[str, list[Value]] = {
                "count": [11, -1, 1.5, "two"], "rate": [-2.0, 1001.0, "fast"], "label": [],
                "enabled": [2, "perhaps"], daemon_model.SIZE: [0, 9, -1],
            }  # fmt: skip
            wrong = bad.get(name, [-11.0, "heavy"])
            values |= {name: draw.choice(wrong)} if wrong else {"colour": 1}
        return values

    def _value(self, name: str) -> Value:
        draw = self.random
        if name == "enabled":
            return draw.random() < 0.5
        if name == "count":
            return draw.randint(0, 10)
        if name == "label":
            return draw.choice(["abc", "x", "word " * draw.randint(1, 500), "ü", "{}%s"])
        if name == daemon_model.SIZE:
            return draw.randint(1, daemon_model.ELEMENTS)
        return draw.choice([draw.uniform(-1.0, 10.0), float(draw.randint(0, 9)), 1e-3])

    def _wanted(self, name: str) -> Wanted:
        kind = NAMES[name]
        return Wanted(name, kind, self._values(kind, 3) if self.random.random() < 0.6 else {})

    # Operations

    def load(self) -> None:
        """Load a component."""
        runner, wanted = self._runner(), self._wanted(self.random.choice(sorted(NAMES)))
        self._change(
            runner,
            lambda model: model.load(wanted),
            lambda client: client.load(spec(wanted), runner),
        )

    def set_some(self) -> None:
        """Set some parameters at once."""
        runner = self._runner()
        name = self._there(runner)
        batch = self._values(NAMES[name], 3)
        self._change(
            runner,
            lambda model: model.set_some(name, batch),
            lambda client: client.set_parameters(name, settings_of(batch), runner),
        )

    def undo(self) -> None:
        """Undo a change."""
        runner = self._runner()
        name = self._there(runner)
        self._change(
            runner,
            lambda model: model.undo(name),
            lambda client: client.undo_parameters(name, runner),
        )

    def replace(self) -> None:
        """Replace a component, perhaps under another name."""
        self._change(*self._replacement())

    def _replacement(self) -> tuple[str, Callable[[Runner], None], Callable[[rtcf.Client], Any]]:
        runner = self._runner()
        name = self._there(runner)
        same = [each for each, kind in NAMES.items() if kind == NAMES[name]]
        wanted = self._wanted(self.random.choice([name, name, *same]))
        return (
            runner,
            lambda model: model.replace(name, wanted),
            lambda client: client.replace(name, spec(wanted), runner),
        )

    def unload(self) -> None:
        """Unload one or two components."""
        runner = self._runner()
        names = list({self._there(runner), self._there(runner)})
        self._change(
            runner,
            lambda model: model.unload(names),
            lambda client: client.unload(names, runner),
        )

    def _graph(self, runner: str) -> list[Wanted]:
        kept = [
            Wanted(name, each.type, dict(each.given))
            for name, each in self.model.get(runner, Runner()).components.items()
            if self.random.random() < 0.6
        ]
        left = [each for each in NAMES if each not in {one.name for one in kept}]
        new = self.random.sample(left, self.random.randint(0, len(left)))
        return kept + [self._wanted(each) for each in new]

    def apply(self) -> None:
        """Change the graph of one runner."""
        runner = self._runner()
        graph = self._graph(runner)
        self._change(
            runner,
            lambda model: model.apply(graph),
            lambda client: client.apply([spec(each) for each in graph], runner),
        )

    def apply_file(self) -> None:
        """Apply a graph file of several runners, some of them new: all or none."""
        chosen = self.random.sample(RUNNERS, self.random.randint(1, len(RUNNERS)))
        graphs = {runner: self._graph(runner) for runner in chosen}
        after = copy.deepcopy(self.model)
        valid = True
        try:
            for runner, graph in graphs.items():
                after.setdefault(runner, Runner()).apply(graph)
        except Rejected:
            valid = False
        file = self.daemon.folder / "graph.yaml"
        file.write_text(yaml.safe_dump({"runners": {r: document(g) for r, g in graphs.items()}}))
        done = self.daemon.ctl("apply", str(file))
        assert (done.returncode == 0) == valid, (done.stdout, done.stderr, file.read_text())
        if valid:
            self.model = after
        else:
            self.rejected += 1

    def remove(self) -> None:
        """Remove a runner with its history."""
        runner = self._runner()
        if runner != "rt_runner":
            self.client.remove_runner(runner)
            del self.model[runner]

    def run_loop(self) -> None:
        """Start or stop a loop."""
        runner = self._runner()
        if self.random.random() < 0.5:
            self.client.start(runner)
        else:
            self.client.stop(runner)

    def kill(self) -> None:
        """Kill an executor: the next one has the same graph."""
        runner = self._runner()
        pid = self._status(runner).pid
        kill(pid)
        self._wait_for_executor(runner, pid)

    def restart(self) -> None:
        """Restart rtcfd, mostly by a kill."""
        self._end_of_rtcfd(self.random.choice([signal.SIGKILL, signal.SIGKILL, signal.SIGTERM]))
        self._start_rtcfd()

    def interrupt(self) -> None:
        """Kill an executor or rtcfd in the middle of a change."""
        runner, expect, change = self._replacement()
        if self.random.random() < 0.5:
            name = self._there(runner)
            batch = self._values(NAMES[name], 3)
            expect = lambda model: model.set_some(name, batch)  # noqa: E731
            change = lambda client: client.set_parameters(name, settings_of(batch), runner)  # noqa: E731
        before = copy.deepcopy(self.model[runner])
        after = copy.deepcopy(before)
        try:
            expect(after)
        except Rejected:
            after = before
        errors: list[rtcf.RtcfError] = []

        def attempt() -> None:
            with rtcf.Client(self.daemon.socket) as client:
                try:
                    change(client)
                except rtcf.RtcfError as error:
                    errors.append(error)

        pid = self._status(runner).pid
        thread = threading.Thread(target=attempt)
        thread.start()
        time.sleep(self.random.uniform(0.0, LONGEST_DELAY_S))
        daemon_dies = self.random.random() < 0.3
        if daemon_dies:
            self._end_of_rtcfd(signal.SIGKILL)
        else:
            kill(pid)
        thread.join(60.0)
        assert not thread.is_alive()
        if daemon_dies:
            self._start_rtcfd()
        self._wait_for_executor(runner, pid if not daemon_dies else 0)
        found = self._found(runner)
        if not errors or found != contents(before):
            assert found == contents(after), difference(found, contents(after))
        self.model[runner] = after if found == contents(after) else before
        self._learn_history(runner)

    def lease(self) -> None:
        """Lease a component under an odd name."""
        runner, holder = self._runner(), self.random.choice(ODD_NAMES)
        leased = rtcf.component("rtcf_test", "Counter", name="leased")
        opening = control_pb2.OpenLease(
            component=leased, runner=runner, run_id="run", holder=holder,
            on_lost=control_pb2.ON_LEASE_LOST_UNLOAD,
        )  # fmt: skip
        lease = self.client.lease_component(opening)
        messages = iter(lease)
        while next(messages).WhichOneof("kind") != "loaded":
            pass
        (found,) = (
            each for each in self.client.list_components(runner) if each.full_name == "/leased"
        )
        assert found.holder.isprintable()
        self.compare(ignored={"/leased"})
        if self.random.random() < 0.5:
            lease.end()
            assert [each.WhichOneof("kind") for each in messages][-1] == "ended"
        else:
            lease.drop()
        wait_for(lambda: "/leased" not in self._names(runner), "the end of the lease")

    def hang(self) -> None:
        """Load a component whose configure() hangs; meanwhile other runners are changed."""
        runner = self._runner()
        self.files += 1
        plugged = self.daemon.folder / f"plugged{self.files}"
        slow = rtcf.component(
            "rtcf_test", "ConfiguresOnceThereIs", name="slow", parameters=[f"file:={plugged}"]
        )
        loaded: list[bool] = []

        def load() -> None:
            with rtcf.Client(self.daemon.socket) as client:
                try:
                    client.load(slow, runner)
                    loaded.append(True)
                except rtcf.RtcfError:
                    loaded.append(False)

        thread = threading.Thread(target=load)
        thread.start()
        wait_for(lambda: "busy with the load of" in self._status(runner).status, "the hook")
        others = [each for each in self.model if each != runner]
        if others:
            self.client.load(rtcf.component("rtcf_test", "Counter", name="quick"), others[0])
            self.client.unload(["quick"], others[0])
        pid = self._status(runner).pid
        if self.random.random() < 0.5:
            plugged.touch()
            thread.join(60.0)
            assert loaded == [True]
            self.client.unload(["slow"], runner)
            return
        kill(pid)
        thread.join(60.0)
        assert loaded == [False]
        self._wait_for_executor(runner, pid)

    def damage(self) -> None:
        """Leave damaged files in the folder of the state; the readers skip them."""
        state = self.daemon.folder / "state"
        for runner in self.model:
            if (history := state / f"{runner}.history").exists():
                with history.open("ab") as file:
                    file.write(b'{"number": 7, "compon\n\xff\xfe\n[]\n')
        incidents = state / "incidents"
        incidents.mkdir(exist_ok=True)
        garbage = incidents / f"{self._runner()}-2026-01-01T00-00-0{self.random.randint(0, 9)}.rtcf"
        garbage.write_bytes(self.random.randbytes(200))
        self._garbage.add(garbage)
        self.client.list_incidents()
        (state / ".rt_runner.json.tmp").write_bytes(b"{")

    # The parts of these

    def _change(
        self,
        runner: str,
        expect: Callable[[Runner], None],
        change: Callable[[rtcf.Client], Any],
    ) -> None:
        """Make a change that the model accepts; or check that it is rejected."""
        after = copy.deepcopy(self.model[runner])
        try:
            expect(after)
        except Rejected:
            self.rejected += 1
            with pytest.raises(rtcf.RefusedError) as rejected:
                change(self.client)
            assert str(rejected.value).isprintable()
        else:
            change(self.client)
            self.model[runner] = after

    def _status(self, runner: str) -> runner_pb2.RunnerStatus:
        (found,) = self.client.get_status(runner).runners
        return found  # type: ignore[no-any-return]

    def _wait_for_executor(self, runner: str, killed: int = 0) -> None:
        """Wait until a runner has an executor with its whole graph; after many crashes, restart."""

        def settled() -> bool:
            status = self._status(runner)
            if "tries again" in status.status:
                self.client.restart_runner(runner)
                return False
            return status.pid not in (0, killed) and "restored" not in status.status

        wait_for(settled, f"the executor of {runner}")
        # It serialises with the recovery.
        self.client.set_runner(runner_pb2.RunnerSettings(), runner)
        left_out = [
            each.full_name
            for each in self.client.list_components(runner)
            if each.state == graph_pb2.COMPONENT_STATE_LEFT_OUT
        ]
        if left_out:
            self.client.release(left_out, runner)

    def _end_of_rtcfd(self, number: signal.Signals) -> None:
        self.client.close()
        self.daemon.end(number)

    def _start_rtcfd(self) -> None:
        self.daemon.start()
        self.client = rtcf.Client(self.daemon.socket)
        for runner in self.model:
            self._wait_for_executor(runner)

    def _learn_history(self, runner: str) -> None:
        """Take the changes that can be undone from rtcfd: a kill may have cut off the last note."""
        model = self.model[runner]
        stacks: dict[str, list[Change]] = {}
        at: dict[str, int] = {}
        histories = [self._history(name, runner) for name in sorted(NAMES)]
        for each in itertools.chain.from_iterable(histories):
            if each.how == "set, unanswered":
                continue
            stack = stacks.setdefault(each.component, [])
            if at.get(each.component) != each.time_ns:
                if each.how == "undo":
                    stack[-1:] = []  # a change that is too old is dropped
                else:
                    stack.append({})
            at[each.component] = each.time_ns
            if each.how != "undo":
                before = plain(each.before) if each.HasField("before") else None
                stack[-1][each.parameter] = before, plain(each.value)
        for name, known in model.changes.items():
            found = stacks.get(name, [])
            expected: list[list[Change]] = [known, known[:-1], known + found[-1:]]
            assert any(
                found == each[len(each) - len(found) :] and len(found) in (len(each), *LONG)
                for each in expected
            ), f"{name}: {len(found)} changes {found[-2:]}, not {len(known)} {known[-2:]}"
        model.changes = {name: stack for name, stack in stacks.items() if stack}

    def _history(self, name: str, runner: str) -> list[control_pb2.ParameterChange]:
        try:
            return self.client.get_history(name, runner=runner)
        except rtcf.reasons.ComponentNotFoundError:
            return []  # never loaded

    def _found(self, runner: str) -> Contents:
        return {
            each.full_name: (
                each.spec.type,
                {one.name: plain(one.value) for one in each.parameters if one.name != "mode"},
            )
            for each in self.client.list_components(runner)
        }

    def _names(self, runner: str) -> set[str]:
        return {each.full_name for each in self.client.list_components(runner)}

    def compare(self, ignored: frozenset[str] | set[str] = frozenset()) -> None:
        """Compare rtcfd with the model."""
        assert {each.runner for each in self.client.get_status().runners} == self.model.keys()
        for runner, model in self.model.items():
            found = self._found(runner)
            for name in ignored:
                found.pop(name, None)
            assert found == contents(model), difference(found, contents(model))

    def compare_disk(self) -> None:
        """Compare the files with the model."""
        folder = self.daemon.folder / "state"
        assert {each.stem for each in folder.glob("[!.]*.json")} == self.model.keys()
        for runner, model in self.model.items():
            saved = json.loads((folder / f"{runner}.json").read_text())["components"]
            assert {f"{each['ns'].rstrip('/')}/{each['name']}" for each in saved} == set(
                model.components
            )


def kill(pid: int) -> None:
    """Kill a process."""
    assert pid
    os.kill(pid, signal.SIGKILL)


def contents(model: Runner) -> Contents:
    """Return the components of a runner with their values."""
    return {name: (each.type, each.values) for name, each in model.components.items()}


def difference(found: Contents, expected: Contents) -> str:
    """Return the first difference of two graphs."""
    if found.keys() != expected.keys():
        return f"components {sorted(found)}, not {sorted(expected)}"
    name = next(each for each in found if found[each] != expected[each])
    is_now, shall = found[name][1], expected[name][1]
    values = {each: (is_now.get(each), shall.get(each)) for each in is_now.keys() | shall.keys()}
    return f"{name}: { ({each: two for each, two in values.items() if two[0] != two[1]}) }"


def plain(value: graph_pb2.ParameterValue) -> Value:
    """Return a value as Python has it."""
    return getattr(value, str(value.WhichOneof("kind")))  # type: ignore[no-any-return]


def settings_of(values: Values) -> list[graph_pb2.ParameterSetting]:
    """Return values as a client sends them."""
    kinds = {bool: "bool_value", int: "int_value", float: "double_value", str: "string_value"}
    return [
        graph_pb2.ParameterSetting(
            name=name,
            value=graph_pb2.ParameterValue(**{kinds[type(value)]: value}),  # type: ignore[arg-type]
        )
        for name, value in values.items()
    ]


def spec(wanted: Wanted) -> graph_pb2.ComponentSpec:
    """Return a component as a client asks for it, with ports of its own."""
    ns, _, name = wanted.name.rpartition("/")
    result = rtcf.component(
        daemon_model.PACKAGE, wanted.type, name=name, ns=ns or "/", remaps=remaps(wanted)
    )
    result.parameters.extend(settings_of(wanted.given))
    return result


def remaps(wanted: Wanted) -> list[str]:
    """Return private names for the outputs."""
    outputs = {"Knobs": ("product", "length"), "Weights": ("y", "sum", "count")}
    return [f"{port}:=~{port}" for port in outputs[wanted.type]]


def document(graph: list[Wanted]) -> dict[str, Any]:
    """Return a graph as its file has it."""
    return {
        "components": [
            {
                "package": daemon_model.PACKAGE,
                "type": each.type,
                "name": each.name.rpartition("/")[2],
                "ns": each.name.rpartition("/")[0] or "/",
                "remaps": dict(one.split(":=") for one in remaps(each)),
                "parameters": each.given,
            }
            for each in graph
        ]
    }


@pytest.mark.parametrize("rounds", [100, pytest.param(10_000, marks=pytest.mark.long)])
def test_rtcfd_agrees_with_the_model(daemon: Daemon, rounds: int) -> None:
    clients = Clients(daemon, SEED)
    for number in range(rounds):
        try:
            clients.round()
        except BaseException as error:
            error.add_note(f"round {number}, seed {SEED}, after {dict(clients.done)}")
            raise
        if number % 50 == 49:
            clients.restart()
            clients.compare()
            clients.compare_disk()
    clients.client.close()
    print(f"seed {SEED}: {dict(clients.done)}; {clients.rejected} rejected")
    assert clients.rejected > rounds / 20

"""Random changes of a graph while its loop runs at 2 kHz: the graph always matches a reference
model, and the loop is undisturbed.

hypothesis generates the changes and shrinks a failure; `RTCF_SEED` selects others.
"""

import json
import math
import os
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path

import graph_model as model
import hypothesis
import pytest
import rtcf
from daemon_process import Daemon
from graph_model import Graph, Mixer, Values
from hypothesis import stateful
from hypothesis import strategies as st
from realtime_thread import RealtimeThread, resident_kb
from rtcf.v1 import control_pb2, graph_pb2
from values import iteration, number, port_value

# Without reserved heap, so that leaks show immediately.
SETTINGS = "[runner]\nfrequency_hz = 2000.0\nheap_kb = 0\n[runner.ros]\nenabled = false\n"
STEADY = "/steady"  # a component that no change touches
CHANGES_PER_RUN = 50
SEED = int(os.environ.get("RTCF_SEED", "2021"))

NAMES = ["/a", "/b", "/c", "/n/d", "/n/e", "/f"]
picks = st.integers(0, 15)  # index of an existing component, or a missing one
wires = st.sampled_from([f"/w{i}" for i in range(5)])
levels = st.sampled_from([*["/v0", "/v1", "/v2"] * 3, "/w0"])  # a level of another type
inputs = st.sampled_from([*["in1", "in2", "level"] * 6, "in9"])


def batches(min_size: int = 0) -> st.SearchStrategy[dict[str, int]]:
    """Draw values for up to two parameters, some of them invalid."""
    return st.dictionaries(
        st.sampled_from([*["offset", "gain"] * 8, "ofset"]),
        st.sampled_from([*range(10)] * 3 + [-1, -9, 13, 101]),
        min_size=min_size,
        max_size=2,
    )


@st.composite
def mixers(draw: st.DrawFn) -> Mixer:
    """Draw a component, which may be invalid."""
    name = draw(st.sampled_from(NAMES))
    chosen: dict[str, str] = {}
    # Outputs mostly have private names, since two writers of one name are rejected.
    own = name[-1]
    for port, pool in {
        "in1": wires | st.sampled_from(["/wa", "/wb", "/wc", "/wd"]),
        "in2": wires | st.sampled_from(["/wa", "/wd", "/we", "/wf"]),
        "level": levels | st.sampled_from(["/va", "/vb", "/vd"]),
        "out": st.sampled_from([f"/w{own}"] * 5 + ["/w1", "/w2", "/v1"]),
        "half": st.sampled_from([f"/v{own}"] * 5 + ["/v1", "/v2", "/w1"]),
    }.items():
        if draw(st.integers(0, 3)):
            chosen[port] = draw(pool)
    every = draw(st.sampled_from([1] * 12 + [2, 2, 4, 3]))
    return Mixer(
        name,
        chosen,
        draw(batches()),
        first=draw(st.integers(0, 5)) == 0,
        breaks=frozenset(draw(st.sets(inputs, max_size=2))),
        every=every,
        phase=draw(st.integers(0, every - 1)),
    )


@dataclass
class Soak:
    """A daemon whose loop runs through all runs of the machine below, and the counts of changes."""

    daemon: Daemon
    client: rtcf.Client
    changes: int = 0
    rejections: int = 0
    accepted: Counter[str] = field(default_factory=Counter)  # by kind
    resident_kb: list[int] = field(default_factory=list)  # of the executor, after each run


class GraphMachine(stateful.RuleBasedStateMachine):
    """The graph and its model; the test sets `soak`."""

    soak: Soak

    def __init__(self) -> None:
        super().__init__()
        self.client = self.soak.client
        self.graph: Graph = {}
        self.running = False

    @stateful.initialize()
    def begin(self) -> None:
        # Hypothesis repeats a failed run.
        self.client.stop()
        self.client.apply([], "rt_runner")
        self.client.apply([_steady()], "rt_runner")
        self._start()

    def _there(self, pick: int) -> str:
        """Return the name of a component, which exists in most cases."""
        there = sorted(self.graph)
        return there[pick % len(there)] if there and pick < 15 else NAMES[-1]

    @stateful.rule(
        mixer=mixers(),
        free=picks,
        unwilling=st.sampled_from([""] * 12 + ["configure", "start"]),
    )
    def load(self, mixer: Mixer, free: int, unwilling: str) -> None:
        left = [name for name in NAMES if name not in self.graph]
        name = left[free % len(left)] if left and free < 15 else mixer.name
        mixer = replace(mixer, name=name, unwilling=unwilling)
        self._change(
            "load", lambda: model.load(self.graph, mixer), lambda: self.client.load(mixer.spec())
        )

    @stateful.rule(picked=st.lists(picks, min_size=1, max_size=2))
    def unload(self, picked: list[int]) -> None:
        gone = [self._there(pick) for pick in picked]
        self._change(
            "unload", lambda: model.unload(self.graph, gone), lambda: self.client.unload(gone)
        )

    @stateful.rule(pick=picks, mixer=mixers(), renamed=st.booleans())
    def replacement(self, pick: int, mixer: Mixer, renamed: bool) -> None:
        old = self._there(pick)
        if not renamed:
            mixer = replace(mixer, name=old)
        self._change(
            "replacement",
            lambda: model.replaced(self.graph, old, mixer),
            lambda: self.client.replace(old, mixer.spec()),
        )

    @stateful.rule(
        pick=picks, port=st.sampled_from(["in1", "in2"]), to=wires | st.sampled_from(["/wa", "/wc"])
    )
    def rewire(self, pick: int, port: str, to: str) -> None:
        old = self._there(pick)
        mixer = self.graph.get(old, Mixer(old))
        mixer = replace(mixer, wires={**mixer.wires, port: to})
        self._change(
            "rewire",
            lambda: model.replaced(self.graph, old, mixer),
            lambda: self.client.replace(old, mixer.spec()),
        )

    @stateful.rule(
        picked=st.lists(st.tuples(picks, inputs), min_size=1, max_size=2), on=st.booleans()
    )
    def breaks(self, picked: list[tuple[int, str]], on: bool) -> None:
        ports = [(self._there(pick), port) for pick, port in picked]
        wanted = [control_pb2.PortName(component=name, port=port) for name, port in ports]
        self._change(
            "breaks",
            lambda: model.set_breaks(self.graph, ports, on),
            lambda: self.client.set_breaks(wanted, on),
        )

    @stateful.rule(pick=picks, batch=batches(min_size=1))
    def parameters(self, pick: int, batch: dict[str, int]) -> None:
        name = self._there(pick)
        wanted = [rtcf.parse_parameter(f"{each}:={value}") for each, value in batch.items()]
        self._change(
            "parameters",
            lambda: model.set_parameters(self.graph, name, batch),
            lambda: self.client.set_parameters(name, wanted),
        )

    @stateful.rule(
        others=st.lists(mixers(), max_size=2), gone=st.sets(st.sampled_from(NAMES), max_size=2)
    )
    def apply(self, others: list[Mixer], gone: set[str]) -> None:
        """Replace the graph with another one, of which a part stays unchanged."""
        new = {mixer.name: mixer for mixer in others}
        kept = [mixer for name, mixer in self.graph.items() if name not in gone | new.keys()]
        wanted = [*kept, *others]
        self._change(
            "apply",
            lambda: model.applied(self.graph, wanted),
            lambda: self.client.apply(
                [_steady(), *(mixer.spec() for mixer in wanted)], "rt_runner"
            ),
        )

    @stateful.precondition(lambda self: len(self.graph) > 2)
    @stateful.rule()
    def values(self) -> None:
        """Stop the loop, step it and compare each value; then start it again."""
        self._end_of_loop()
        self.client.step(12)  # each component has run at any rate
        values = self._values()
        for cycle in range(12, 15):
            values = model.run_cycle(self.graph, cycle, values)
            self.client.step(1)
            assert self._values() == values, cycle
        self._saved()
        self.client.stop()
        self._start()

    @stateful.invariant()
    def the_graph_is_that_of_the_model(self) -> None:
        expected = model.order(self.graph)
        found = self.client.list_components()
        assert [each.full_name for each in found if each.full_name != STEADY] == expected
        for each in found:
            if each.full_name == STEADY:
                continue
            mixer = self.graph[each.full_name]
            assert {port.name: port.mapped_name for port in each.ports} == {
                port: mixer.mapped(port) for port in model.TYPES
            }
            values = {p.name: p.value.int_value for p in each.parameters if p.name != "unwilling"}
            assert values == {name: mixer.value(name) for name in model.DEFAULTS}
            spec = each.spec
            assert (spec.first, frozenset(spec.breaks)) == (mixer.first, mixer.breaks)
            assert (max(1, spec.every), spec.phase) == (mixer.every, mixer.phase)
        assert {
            each.name: model.Connection(
                frozenset(
                    (end.component, end.port)
                    for end in ([each.writer] if each.HasField("writer") else [])
                    + list(each.other_writers)
                ),
                frozenset((end.component, end.port, end.broken) for end in each.readers),
            )
            for each in self.client.list_connections()
            if not each.name.startswith(STEADY)
        } == model.connections(self.graph)

    def teardown(self) -> None:
        if not self.running:
            return  # after a failure
        self._end_of_loop()
        self._saved()
        self.client.unload([*self.graph, STEADY])
        self.soak.resident_kb.append(resident_kb(self.thread.process))

    def _change(self, kind: str, expect: Callable[[], Graph], change: Callable[[], object]) -> None:
        """Make a change that the model accepts; or check that it fails without any change."""
        self.soak.changes += 1
        try:
            graph = expect()
        except model.Refused:
            self.soak.rejections += 1
            before = self._generation()
            with pytest.raises(rtcf.RefusedError) as refused:
                change()
            assert "\n" not in str(refused.value)
            assert self._generation() == before
        else:
            change()
            self.soak.accepted[kind] += 1
            self.graph = graph

    def _start(self) -> None:
        before = port_value(self.client, STEADY, "out")
        self.steady_before = 0.0 if math.isnan(before) else before
        self.client.start()
        self.running = True
        self.thread = RealtimeThread(self.client)

    def _end_of_loop(self) -> None:
        """Stop the loop, which the changes did not disturb."""
        self.thread.check()
        self.running = False
        self.client.stop()
        updates = port_value(self.client, STEADY, "out") - self.steady_before
        assert updates == iteration(self.client), "one update per cycle"

    def _generation(self) -> int:
        return int(self.client.get_status("rt_runner").runners[0].generation)

    def _values(self) -> Values:
        """Return the values of outputs, and of inputs without a writer."""
        found: Values = {}
        for name in self.graph:
            for port in self.client.get_component(name).ports:
                if port.name in model.OUTPUTS or not port.connected:
                    found[name, port.name] = number(port.value) if port.HasField("value") else 0.0
        return found

    def _saved(self) -> None:
        """Check that the state on disk is the same graph."""
        file = self.soak.daemon.socket.with_name("state") / "rt_runner.json"
        saved = {
            f"{each['ns'].rstrip('/')}/{each['name']}": each
            for each in json.loads(file.read_text())["components"]
        }
        del saved[STEADY]
        assert saved.keys() == self.graph.keys()
        for name, each in saved.items():
            assert frozenset(each.get("breaks", ())) == self.graph[name].breaks
            values = {
                p["name"]: int(p["value"]["int_value"])
                for p in each.get("parameters", ())
                if p["name"] != "unwilling"
            }
            assert {**model.DEFAULTS, **values} == {
                parameter: self.graph[name].value(parameter) for parameter in model.DEFAULTS
            }


def _steady() -> graph_pb2.ComponentSpec:
    remaps = [f"{port}:=~{port}" for port in ("in", "out")]
    return rtcf.component("rtcf_test", "Counter", name="steady", remaps=remaps)


@pytest.fixture
def soak(tmp_path: Path) -> Iterator[Soak]:
    """Yield a soak with a loop at 2 kHz."""
    daemon = Daemon(tmp_path, SETTINGS)
    daemon.start()
    with rtcf.Client(daemon.socket) as client:
        yield Soak(daemon, client)
    daemon.end()


# Hypothesis starts with some short runs.
@pytest.mark.parametrize(
    ("runs", "changes"), [(20, 200), pytest.param(230, 10_000, marks=pytest.mark.long)]
)
def test_random_changes_leave_the_graph_of_the_model(soak: Soak, runs: int, changes: int) -> None:
    class Machine(GraphMachine):
        pass

    Machine.soak = soak
    stateful.run_state_machine_as_test(  # type: ignore[no-untyped-call]
        hypothesis.seed(SEED)(Machine),
        settings=hypothesis.settings(
            max_examples=runs,
            stateful_step_count=CHANGES_PER_RUN,
            deadline=None,
            database=None,
            suppress_health_check=list(hypothesis.HealthCheck),
            # Report a failure as it occurred: a loop that has failed cannot be shrunk.
            phases=[hypothesis.Phase.generate],
            print_blob=False,
        ),
    )
    print(
        f"{soak.changes} changes, {soak.rejections} of them rejected; "
        f"accepted: {dict(soak.accepted)}"
    )
    runs_at = {kb: run for run, kb in reversed(list(enumerate(soak.resident_kb)))}
    print(f"memory of the executor, KiB, and since which run: {runs_at}")
    assert soak.changes >= changes
    assert soak.rejections > 0
    kinds = {"load", "unload", "replacement", "rewire", "breaks", "parameters", "apply"}
    assert soak.accepted.keys() == kinds, "each kind of change succeeded at least once"
    # All tables reach their size within some hundred changes.
    if (warm := len(soak.resident_kb) // 2) >= 100:
        assert soak.resident_kb[-1] <= soak.resident_kb[warm]

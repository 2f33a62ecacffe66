"""The desired state of one runner: accepted settings and components, leases, and loop state.

Owned by its Runner; store.py keeps it on disk.
"""

from collections.abc import Iterable
from dataclasses import dataclass, field
from pathlib import Path

from google.protobuf import json_format
from rtcf.v1 import graph_pb2, runner_pb2

from rtcfd.common import names, runner_settings
from rtcfd.common.names import absolute
from rtcfd.state.history import History

_BOOT_ID = Path("/proc/sys/kernel/random/boot_id")


def this_boot() -> str:
    """Return the id of the current boot of the machine."""
    return _BOOT_ID.read_text(encoding="ascii").strip()


@dataclass(frozen=True)
class ComponentLeaseTerms:
    """The terms of a lease on a component; see runners/component_leases.py."""

    run_id: str
    on_lost: int  # OnLeaseLost
    holder: str  # name for messages
    # Component and number of each change in the history to undo if the holder dies.
    changes: list[tuple[str, int]] = field(default_factory=list)


@dataclass
class RunnerLeaseTerms:
    """The terms of a lease on a runner; see runners/runner_leases.py."""

    token: str
    holder: str  # name for messages
    parked: runner_pb2.RunnerSettings  # the runner's own settings, restored at the end
    added: bool = False  # the runner exists only for this lease


class Desired:
    """The chosen settings (unset ones follow the defaults) and the components of a runner."""

    def __init__(self, runner: str) -> None:
        self.runner = runner
        self.chosen = runner_pb2.RunnerSettings()
        self.running = False  # the loop was started, and neither stopped nor ended by a fault
        self.ended_boot = ""  # the boot in which the loop ended; empty: it runs, or never ran
        self.quarantined: dict[str, str] = {}  # components removed by a fault, with the reason
        self.left_out: dict[str, str] = {}  # components that are not loaded, with the reason
        self.leased: dict[str, ComponentLeaseTerms] = {}  # leased components, which are not saved
        self.hold: RunnerLeaseTerms | None = None
        self.replaced = ""  # changes by hand that its graph file replaced at this start
        self.history = History()  # of its parameters
        self._components: dict[str, graph_pb2.ComponentSpec] = {}
        # The saved text of each component, cached: a change of one component among a thousand
        # costs the conversion of one.
        self._texts: dict[str, str] = {}

    @property
    def components(self) -> dict[str, graph_pb2.ComponentSpec]:
        """All components by full name, in the order of loading.  Read-only."""
        return self._components

    def complete(self, defaults: runner_pb2.RunnerSettings) -> runner_pb2.RunnerSettings:
        """Return all settings."""
        return runner_settings.completed(runner_settings.merged(defaults, self.chosen))

    def effect(
        self, change: runner_pb2.RunnerSettings, defaults: runner_pb2.RunnerSettings
    ) -> runner_pb2.RunnerSettings:
        """Return a change of settings, with the priority if it changes as a consequence."""
        chosen = runner_settings.merged(self.chosen, change)
        after = runner_settings.completed(runner_settings.merged(defaults, chosen))
        result = runner_pb2.RunnerSettings()
        result.CopyFrom(change)
        if after.priority != self.complete(defaults).priority:
            result.priority = after.priority
        return result

    def choose(self, change: runner_pb2.RunnerSettings) -> None:
        """Note accepted settings."""
        self.chosen = runner_settings.merged(self.chosen, change)

    def put(self, full_name: str, spec: graph_pb2.ComponentSpec) -> None:
        """Note a new or changed component under its full name."""
        kept = graph_pb2.ComponentSpec()
        kept.CopyFrom(spec)
        namespace, _, kept.name = full_name.rpartition("/")
        kept.ns = namespace or "/"
        self._components[full_name] = kept
        self._texts.pop(full_name, None)
        self.quarantined.pop(full_name, None)

    def settle(self, full_name: str, spec: graph_pb2.ComponentSpec) -> None:
        """If a component has lists, note its parameters with the sizes of its vectors instead."""
        kept = self._components[full_name]
        if kept.lists:
            del kept.parameters[:], kept.lists[:]
            kept.parameters.extend(spec.parameters)
            self._texts.pop(full_name, None)

    def drop(self, full_names: Iterable[str]) -> None:
        """Remove components."""
        for name in full_names:
            self._components.pop(name, None)
            self._texts.pop(name, None)
            self.quarantined.pop(name, None)
            self.left_out.pop(name, None)
            self.leased.pop(name, None)

    def let_go(self) -> None:
        """Remove all leases and leased components, and restore the runner's own settings."""
        self.drop(list(self.leased))
        if self.hold is not None:
            self.chosen = self.hold.parked
            self.hold = None

    def quarantine(self, full_name: str, reason: str) -> bool:
        """Note that a component must not be loaded until it is released.

        Returns whether there is one of this name.
        """
        if full_name not in self._components:
            return False
        self.quarantined[full_name] = reason
        return True

    def become(self, specs: Iterable[graph_pb2.ComponentSpec]) -> None:
        """Replace all components by those of a graph."""
        before, texts = self._components, self._texts
        self._components, self._texts, self.quarantined = {}, {}, {}
        for spec in specs:
            name = names.full_name(spec)
            self.put(name, spec)
            if name in texts and before[name] == self._components[name]:
                self._texts[name] = texts[name]
        self.leased = {
            name: terms for name, terms in self.leased.items() if name in self._components
        }

    def set_breaks(self, full_name: str, live: graph_pb2.ComponentSpec) -> None:
        """Note the loop breaks that a component has in the executor."""
        spec = self._components.get(full_name)
        if spec is not None:
            spec.first, spec.ignore = live.first, live.ignore
            spec.breaks[:] = live.breaks
            self._texts.pop(full_name, None)

    def set_parameters(self, component: str, changes: Iterable[graph_pb2.ParameterSetting]) -> None:
        """Note changed parameters of a component."""
        name = absolute(component)
        spec = self._components.get(name)
        if spec is None:
            return
        values = {setting.name: setting for setting in spec.parameters}
        values.update({setting.name: setting for setting in changes})
        parameters = list(values.values())
        del spec.parameters[:]
        spec.parameters.extend(parameters)
        self._texts.pop(name, None)

    def component_texts(self) -> list[str]:
        """Return each component that is not leased, as a line of JSON."""
        staying = [name for name in self._components if name not in self.leased]
        for name in staying:
            if name not in self._texts:
                self._texts[name] = json_format.MessageToJson(
                    self._components[name], preserving_proto_field_name=True, indent=None
                )
        return [self._texts[name] for name in staying]


def replacement(
    old: graph_pb2.ComponentSpec | None, given: graph_pb2.ComponentSpec
) -> graph_pb2.ComponentSpec:
    """Return the spec of a replacement.

    Name, namespace, remaps, flags and breaks that are empty in `given` are those of `old`.
    """
    result = graph_pb2.ComponentSpec()
    if old is not None:
        result.CopyFrom(old)
        del result.parameters[:]  # the executor keeps those that fit
        del result.lists[:]
    for name in ("remaps", "breaks"):
        if getattr(given, name):
            result.ClearField(name)
    result.MergeFrom(given)
    return result

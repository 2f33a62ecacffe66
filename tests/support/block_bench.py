"""Components of rtcf_control side by side in one bench, each with its own ports."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import rtcf
from daemon_process import BUILD_TREE
from rtcf.connection import Closing
from rtcf.testing import Bench
from rtcf_shared.value_text import parse

PATH = [BUILD_TREE / "lib" / "rtcf"]
Values = dict[str, Any]


@contextmanager
def rejection(said: str) -> Iterator[None]:
    """Check that a call within the `with` block is rejected with a text in one line."""
    with pytest.raises(rtcf.RefusedError) as error:
        yield
    found = str(error.value)
    assert said in found, found
    assert "\n" not in found, found


def text(matrix: Any) -> str:
    """Return a matrix as a text that reads back exactly."""
    return "; ".join(" ".join(repr(float(each)) for each in row) for row in np.atleast_2d(matrix))


def columns(name: str, values: Any) -> Values:
    """Return inputs NAME1, NAME2 ... of values with a row for each cycle."""
    return {f"{name}{i + 1}": column for i, column in enumerate(np.asarray(values).T)}


class Blocks(Closing):
    """One component of each type given, in the namespace /TYPE."""

    def __init__(
        self, folder: Path, types: Iterable[str], *, frequency_hz: float | None = None
    ) -> None:
        file = folder / "blocks.yaml"
        lines = [f"  - {{name: {each}, ns: /{each}, package: rtcf_control, type: {each}}}\n"
                 for each in types]  # fmt: skip
        file.write_text("components:\n" + "".join(lines))
        self._bench = Bench(str(file), path=PATH, frequency_hz=frequency_hz)
        self._defaults = {each: self._parameters(each) for each in types}
        self._present = dict(self._defaults)

    @property
    def client(self) -> rtcf.Client:
        """Everything else that a client can ask."""
        return self._bench.client

    @property
    def logs(self) -> list[str]:
        """The log records of components as "/component: text", oldest first."""
        return self._bench.logs

    def close(self) -> None:
        self._bench.close()

    def set(self, type_: str, **parameters: Any) -> None:
        """Set parameters; those not given get their defaults."""
        wanted = {**self._defaults[type_], **parameters}
        present = self._present[type_]
        changed = {name: value for name, value in wanted.items() if value != present.get(name)}
        if changed:
            self._bench.set(f"/{type_}/{type_}", **changed)
            self._present[type_] = wanted

    def run(
        self,
        type_: str,
        inputs: Mapping[str, Any] | None = None,
        steps: int | None = None,
        **parameters: Any,
    ) -> Values:
        """Run a new component of the type; return its outputs by name, NaN before the first."""
        self.set(type_, **parameters)
        full = f"/{type_}/{type_}." if len(self._defaults) > 1 else ""
        response = self._bench.run(
            {full + name: values for name, values in (inputs or {}).items()}, steps
        )
        return {
            name.removeprefix(full): values
            for name, values in response.items()
            if name.startswith(full)
        }

    def out(
        self,
        type_: str,
        inputs: Mapping[str, Any] | None = None,
        steps: int | None = None,
        *,
        output: str = "out",
        **parameters: Any,
    ) -> Any:
        """Run a new component as run() does, twice; return one output."""
        return self.run_twice(type_, [output], inputs, steps, **parameters)[output]

    def run_twice(
        self,
        type_: str,
        compared: Iterable[str],
        inputs: Mapping[str, Any] | None = None,
        steps: int | None = None,
        **parameters: Any,
    ) -> Values:
        """Run a new component as run() does, twice; check that outputs are equal; return all."""
        first = self.run(type_, inputs, steps, **parameters)
        again = self.run(type_, inputs, steps, **parameters)
        for name in compared:
            equal = again[name].tobytes() == first[name].tobytes()
            assert equal, f"{name}: the same inputs gave other outputs"
        return first

    def _parameters(self, type_: str) -> Values:
        found = self._bench.client.get_component(f"/{type_}/{type_}")
        return {
            each.name: getattr(each.value, str(each.value.WhichOneof("kind")))
            for each in found.parameters
        }


class Stepped:
    """One component in a stepped loop: parameters, replacements and snapshots between cycles."""

    def __init__(self, bench: Bench, type_: str, **parameters: Any) -> None:
        self.client = bench.client
        self._type = type_
        self.client.load(self.spec(**parameters))

    def spec(self, type_: str = "", package: str = "rtcf_control", **parameters: Any) -> Any:
        """Return the component with other parameters, or of another type."""
        words = [f"{name}:={str(value).lower() if isinstance(value, bool) else value}"
                 for name, value in parameters.items()]  # fmt: skip
        return rtcf.component(package, type_ or self._type, name="block", ns="/stepped",
                              parameters=words)  # fmt: skip

    def write(self, **inputs: Any) -> None:
        """Give inputs a value in the next cycle."""
        for name, value in inputs.items():
            self.client.write(f"/stepped/block.{name}", value)

    def step(self, cycles: int = 1, /, **inputs: Any) -> Values:
        """Run cycles; return the state."""
        self.write(**inputs)
        self.client.step(cycles)
        return self.state

    def set(self, **parameters: Any) -> None:
        self.client.set_parameters(
            "/stepped/block",
            list(self.spec(**parameters).parameters),
        )

    @property
    def state(self) -> Values:
        found = self.client.get_component("/stepped/block")
        return {each.name: parse(each.value) for each in found.states}

    def unload(self) -> None:
        self.client.unload(["/stepped/block"])

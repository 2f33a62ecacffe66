"""Private names: `_x` of states and Derived members, constants and methods, `__x` of a class."""

from pathlib import Path
from typing import Any

import pytest
from pages import TREE
from rtcf.component import DeclarationError, describe
from rtcf.component.declaration import State
from rtcf_compile.comparison import verify
from rtcf_compile.machine_code import object_file
from rtcf_compile.source import modules

CONTROLLERS: Any = modules.load(TREE / "tests" / "components" / "python" / "controllers.py")
INHERITED = """\
from rtcf.component import Component, Derived, Input, Output, State


class _Base(Component):
    u: Input[float]
    y: Output[float]
    _sum: State[float] = 1.0
    _count: State[int]
    __GAIN = 2.0
    _LIMIT = 100.0

    def _next(self):
        return self._sum + self.__GAIN * self.u.value

    def __more(self):
        return 1.0

    def more(self):
        return self.__more()

    def update(self):
        self._count += 1
        self._sum = min(self._next(), self._LIMIT)
        self.y.write(self._sum + self.more())


class Redeclared(_Base):
    _sum: State[float] = State(5.0, unit="m")
    _peak: State[float | None]
    __GAIN = 3.0
    _LIMIT = 50.0

    def _next(self):
        return super()._next() + self.__GAIN

    def __more(self):
        return 10.0

    def update(self):
        super().update()
        self._peak = self._sum if self._peak is None else max(self._peak, self.__more())


class Other(_Base):
    sum: Input[float]

    def update(self):
        super().update()
        self._sum += self.sum.value
"""


def loaded(folder: Path, text: str) -> Any:
    file = folder / "private.py"
    file.write_text(text)
    return modules.load(file)


def test_attributes_keep_the_underscore_and_states_lose_it_outside() -> None:
    integrator: Any = CONTROLLERS.Integrator(ki=4.0)
    integrator.u.put(1.0)
    integrator.cycle()
    assert integrator._gain == 2.0
    assert integrator._integral == integrator.integral.value == 0.5 + 2.0 * 0.001
    assert (integrator._last, integrator._time, integrator._record) == (1.0, 0, 0)
    assert integrator._memory.tolist() == integrator._sums[:2].tolist()
    integrator._integral = 7.0
    integrator.cycle()
    assert integrator.integral.value > 7.0
    states = [each.outer_name for each in describe(CONTROLLERS.Integrator).of(State)]
    assert states == ["integral", "last", "last__known", "latched", "sums", "time", "record",
                      "memory"]  # fmt: skip


def test_undeclared_private_names_are_rejected_in_the_interpreter() -> None:
    integrator: Any = CONTROLLERS.Integrator()
    with pytest.raises(AttributeError, match=r"_sum is not declared: write `_sum: State\[float\]`"):
        integrator._sum = 1.0

    class Derived(CONTROLLERS.Integrator):  # type: ignore[misc]
        def reset(self) -> None:
            self.__sum = 1.0

    with pytest.raises(AttributeError, match=r"^__sum is not declared: write `_sum: State"):
        Derived().reset()


@pytest.mark.parametrize("name", ["Redeclared", "Other"])
def test_private_names_of_bases_mean_what_python_means(name: str, tmp_path: Path) -> None:
    module = loaded(tmp_path, INHERITED)
    cls = getattr(module, name)
    found = verify.compare(cls, object_file.compile_component(cls), 600)
    assert found.differences == [] and found.raised == 0


def test_a_redeclared_private_state_has_one_place(tmp_path: Path) -> None:
    module = loaded(tmp_path, INHERITED)
    redeclared: Any = module.Redeclared()
    redeclared.u.put(1.0)
    redeclared.cycle()
    # 5 + 2 * 1 of the base, and 3 of the derived class; 1 of the base's own __more().
    assert (redeclared._sum, redeclared.y.value, redeclared._peak) == (10.0, 11.0, 10.0)
    states = {each.outer_name: each.initial for each in describe(module.Redeclared).of(State)}
    assert states["sum"].item() == 5.0 and len(states) == 4


def test_two_states_of_one_outer_name_are_rejected(tmp_path: Path) -> None:
    module = loaded(tmp_path, INHERITED + "\n\nclass Both(_Base):\n    sum: State[float]\n")
    with pytest.raises(DeclarationError, match=r"private\.py:\d+: `sum: State\[float\]`: Both\.sum "
                       "and _sum are both sum outside the component: rename one"):  # fmt: skip
        describe(module.Both)


def test_constants_whose_names_are_alike_are_kept_apart(tmp_path: Path) -> None:
    module = loaded(
        tmp_path,
        "from rtcf.component import Component, Input, Output\n\n"
        "GAINS = {'k-p': 1.0, 'k_p': 2.0}\n\n\nclass Gains:\n    KP = 3.0\n\n\n"
        "class Named(Component):\n    u: Input[float]\n    y: Output[float]\n"
        "    Gains_KP = 4.0\n    _KP = 5.0\n    KP = 6.0\n\n    def update(self):\n"
        "        first = GAINS['k-p'] + 10 * GAINS['k_p'] + 100 * Gains.KP\n"
        "        self.y.write(first + 1e3 * self.Gains_KP + 1e4 * self._KP + 1e5 * self.KP)\n",
    )
    compiled = object_file.compile_component(module.Named)
    assert verify.compare(module.Named, compiled, 50).differences == []
    named: Any = module.Named()
    named.cycle()
    assert named.y.value == 654321.0

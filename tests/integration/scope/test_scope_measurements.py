"""Measurements on the scope's page: those of rtcf.testing, and true of known signals."""

import json
import math
from collections.abc import Iterator
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
import rtcf
from browser import Page
from daemon_process import Daemon
from rtcf.testing import step_response
from scope_pages import Opener
from scope_process import ScopeProcess, looping

RATE_HZ = 2000.0


@pytest.fixture(scope="module")
def loop(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Daemon]:
    """Yield a daemon with a loop."""
    components = [rtcf.component("rtcf_test", "Ragged", name="ragged")]
    with looping(tmp_path_factory.mktemp("loop"), components, 500.0) as daemon:
        yield daemon


@pytest.fixture
def page(visit: Opener, scope: ScopeProcess) -> Page:
    """Return a page with two traces."""
    page = visit(scope, '{"panes":[{"traces":["/ragged.spikes","/ragged.holes"]}]}')
    page.wait("scope.rate && scope.live.end > 200")
    return page


def _response(
    draw: np.random.Generator,
) -> tuple[npt.NDArray[np.float64], npt.NDArray[np.float64], float, float, float]:
    """Return times, a step response of a random system of second order with some noise, the level
    before the step, its target and its time.
    """
    time = np.arange(int(draw.uniform(2000, 12000))) / RATE_HZ
    initial, target = draw.uniform(-3, 3, 2)
    zero, damping = time[int(draw.integers(100, 900))], draw.uniform(0.2, 1.5)
    pole = draw.uniform(3, 60)
    since = np.maximum(time - zero, 0.0)
    turn = np.sqrt(complex(damping**2 - 1))
    fast, slow = -pole * (damping + turn), -pole * (damping - turn)
    share = (1 + (slow * np.exp(fast * since) - fast * np.exp(slow * since)) / (fast - slow)).real
    noise = draw.normal(0.0, draw.choice([0.0, 1e-3]), time.size) * abs(target - initial)
    return time, initial + share * (target - initial) + noise, initial, target, zero


def _asked(page: Page, expression: str) -> dict[str, Any]:
    found: dict[str, Any] = page.ask(
        "(async () => { const m = await import('/page/data/measure.js');"
        f"return {expression}; }})()"
    )
    return found


def test_steps_have_the_measures_of_rtcf_testing(page: Page) -> None:
    for seed in range(50):
        _check_step(page, seed)


def _check_step(page: Page, seed: int) -> None:
    time, value, initial, target, zero = _response(np.random.default_rng(seed))
    begin = int(np.searchsorted(time, zero))
    wanted = step_response(time[begin:], value[begin:], target, initial)
    given = json.dumps({"initial": initial, "target": target, "zero": zero})
    signal = f"Float64Array.from({time.tolist()}), Float64Array.from({value.tolist()})"
    found = _asked(page, f"m.step({signal}, {given})")
    assert found["overshoot"] == pytest.approx(100 * wanted.overshoot, abs=1e-9)
    for ours, theirs in (("rise", wanted.rise_time), ("settling", wanted.settling_time)):
        assert (found[ours] is None) == (not math.isfinite(theirs)), wanted
        if found[ours] is not None:
            assert found[ours] == pytest.approx(theirs, abs=1e-9)
    assert (found["why"] == "") == (wanted.unsettled == "")


def test_a_step_is_found_without_its_target(page: Page) -> None:
    time = np.arange(8000) / RATE_HZ
    since = np.maximum(time - 1.0, 0.0)
    damped = np.exp(-6.0 * since) * (np.cos(20.0 * since) + 0.3 * np.sin(20.0 * since))
    value = 2.0 + 3.0 * (1.0 - damped)
    begin = int(np.searchsorted(time, 1.0))
    wanted = step_response(time[begin:], value[begin:], 5.0, 2.0)
    signal = f"Float64Array.from({time.tolist()}), Float64Array.from({value.tolist()})"
    found = _asked(page, f"m.step({signal})")
    assert found["overshoot"] == pytest.approx(100 * wanted.overshoot, abs=0.01)
    assert found["rise"] == pytest.approx(wanted.rise_time, abs=1e-4)
    # The value leaves its level by 0.1 % of the step some cycles after the step itself.
    assert found["settling"] == pytest.approx(wanted.settling_time, abs=0.005)


FREQUENCIES = {
    "sine": ("Math.sin(2 * Math.PI * 50 * t)", 50.0, 1e-9),
    "noisy sine": ("Math.sin(2 * Math.PI * 50 * t) + 0.6 * noise()", 50.0, 1e-3),
    "noisy sine of few periods": ("Math.sin(2 * Math.PI * 0.4 * t) + 0.3 * noise()", 0.4, 0.02),
    "square": ("Math.sign(Math.sin(2 * Math.PI * 0.7 * t))", 0.7, 1e-4),
    "pulses": ("(3 * t) % 1 < 0.05 ? 1 : 0", 3.0, 1e-3),
    "saw": ("(3.3 * t) % 1", 3.3, 1e-9),
    "near half of the rate": ("Math.sin(2 * Math.PI * 990 * t)", 990.0, 1e-3),
    "harmonics": ("Math.sin(2 * Math.PI * 50 * t) + Math.cos(2 * Math.PI * 150 * t)", 50.0, 1e-3),
    "offset": ("1e6 + Math.sin(2 * Math.PI * 20 * t)", 20.0, 1e-6),
    "constant": ("101325", None, 0.0),
    "constant with rounding": ("101325 + 1e-10 * noise()", None, 0.0),
    "noise": ("noise()", None, 0.0),
    "ramp": ("t", None, 0.0),
    "step": ("t < 3 ? 0 : 1", None, 0.0),
    "one period": ("Math.sin(2 * Math.PI * 0.1 * t)", None, 0.0),
}


def test_the_frequency_is_that_of_a_periodic_signal(page: Page) -> None:
    for signal, (formula, wanted, within) in FREQUENCIES.items():
        found = _frequency(page, formula)
        if wanted is None:
            assert found is None, signal
        else:
            assert found == pytest.approx(wanted, rel=within), signal


def _frequency(page: Page, formula: str) -> float | None:
    """Return the frequency of a formula of the time t, 10 s long."""
    found: float | None = page.ask(
        f"""(async () => {{
          const {{ frequency }} = await import("/page/data/measure.js");
          let state = 1;
          const random = () => (state = (state * 16807) % 2147483647) / 2147483647;
          const noise = () => Math.sqrt(-2 * Math.log(random())) * Math.cos(6.283 * random());
          const times = Float64Array.from({{ length: 20000 }}, (_, i) => i / {RATE_HZ});
          const values = times.map((t) => {formula});
          return frequency(times, values, Math.min(...values), Math.max(...values));
        }})()"""
    )
    return found


def test_target_and_time_of_a_step_are_set_on_the_page(page: Page) -> None:
    page.wait("document.querySelectorAll('.drawer[data-drawer=measurements] option').length === 2")
    page.ask(
        """(() => {
          const drawer = document.querySelector(".drawer[data-drawer=measurements]");
          const set = (key, value) => {
            const input = drawer.querySelector(`[data-key=${key}]`);
            input.value = value;
            input.dispatchEvent(new Event("input"));
          };
          const select = drawer.querySelector("select");
          select.value = "/ragged.holes";
          select.dispatchEvent(new Event("change"));
          set("initial", "0"); set("target", "0.5"); set("zero", "x");
        })()"""
    )
    # Of amplitude 1, twice the target.
    page.wait(
        "[...document.querySelectorAll('.drawer[data-drawer=measurements] tbody tr')]"
        ".find((row) => row.cells[1].textContent === '/ragged.holes')"
        "?.cells[13].textContent.includes('100')"
    )
    told = page.ask(
        "(({ title, className }) => [title, className])(document.querySelector('[data-key=zero]'))"
    )
    assert told == ["x is no number", "wrong"]
    assert page.errors == []


TEXTS = {
    'figure(-12.5, "N")': "−12.5 N",
    "figure(-1.25e-5)": "−1.2500e−5",
    "figure(2.5e13)": "2.5000e13",
    'figure(101325.2, "Pa")': "101\u202f325 Pa",
    'figure(101325.2, "Pa", 0.3)': "101\u202f325.2 Pa",
    'figure(101325.5, "Pa", 0.3)': "101\u202f325.5 Pa",
    "figure(1.000001, '', 1e-6)": "1.000001",
    "fixed(-0.04, 1)": "0.0",
    "fixed(-0.06, 1)": "−0.1",
    "tickText(-2e16, 1e16)": "−2.000e16",
}


def test_texts_of_numbers_have_the_digits_that_tell_them_apart(page: Page) -> None:
    found = page.ask(
        f"""(async () => {{
          const {{ figure, fixed, tickText }} = await import("/page/drawing/axes.js");
          return [{", ".join(TEXTS)}];
        }})()"""
    )
    assert found == list(TEXTS.values())


def test_the_cycles_at_both_cursors_are_measured(page: Page) -> None:
    found = page.ask(
        """(async () => {
          const { measured } = await import("/page/data/measure.js");
          const { Store } = await import("/page/data/store.js");
          const times = Float64Array.from({ length: 40 }, (_, i) => i / 8);
          const zeros = times.map(() => 0);
          const store = Store.of({ count: 40, lost: 0, times, cycles: times.map((_, i) => i),
            latencies: zeros, durations: zeros, traces: [times.map((_, i) => i)] }, ["/a.b"]);
          const { min, max, mean } = measured(store, store.column("/a.b"), times[10], times[20]);
          return [min, max, mean];
        })()"""
    )
    assert found == [10.0, 20.0, 15.0]

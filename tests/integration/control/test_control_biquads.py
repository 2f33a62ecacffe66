"""rtcf_control/Biquads against scipy.signal.

Tolerances: sections with frequencies above 1/100 of the loop's differ from scipy's by less than
ROUNDING, for inputs of size 1 and up to 2000 cycles: scipy computes the same filter in another
form.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest
from block_bench import Blocks, Stepped, rejection
from rtcf.testing import Bench
from rtcf.v1 import runner_pb2
from scipy import signal

RATE = 1000.0
ROUNDING = 1e-9
NOISE = np.random.default_rng(29).uniform(-1.0, 1.0, 2000)


@pytest.fixture(scope="module")
def blocks(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Blocks]:
    with Blocks(tmp_path_factory.mktemp("biquads"), ["Biquads"]) as blocks:
        yield blocks


def section(kind: str, first: float, second: float) -> Any:
    """Return a section of scipy: its own design, or its transform of the analog filter."""
    if kind.startswith("butterworth_"):
        return signal.butter(int(first), second, kind.removeprefix("butterworth_"), fs=RATE,
                             output="sos")  # fmt: skip
    if kind in ("bandpass", "notch"):
        peak = signal.iirpeak if kind == "bandpass" else signal.iirnotch
        b, a = peak(first, second, fs=RATE)
        return np.array([[*b, *a]])
    exact = np.sqrt(first * second) if kind == "lead_lag" else first
    warped = 2.0 * RATE * np.tan(np.pi * exact / RATE)  # rad/s
    if kind == "lead_lag":
        zero, pole = first / exact * warped, second / exact * warped
        numerator, denominator = [1.0 / zero, 1.0], [1.0 / pole, 1.0]
        b, a = signal.bilinear(numerator, denominator, RATE)
        return np.array([[*b, 0.0, *a, 0.0]])
    numerator = {
        "lowpass": [warped**2],
        "highpass": [1.0, 0.0, 0.0],
    }[kind]
    b, a = signal.bilinear(numerator, [1.0, warped / second, warped**2], RATE)
    return np.array([[*b, *a]])


def reference(text: str) -> Any:
    """Return the sections of a text, for scipy."""
    words = [one.split() for one in text.split(";")]
    return np.concatenate([section(kind, float(a), float(b)) for kind, a, b in words])


@pytest.mark.parametrize(
    "text",
    [
        "lowpass 100 0.707",
        "lowpass 20 5",
        "highpass 100 0.707",
        "bandpass 60 2",
        "notch 50 5",
        "bandpass 400 4",
        "notch 450 2",
        "lead_lag 10 100",
        "lead_lag 100 10",
        "lowpass 480 0.5",
        "butterworth_lowpass 1 80",
        "butterworth_lowpass 2 80",
        "butterworth_lowpass 5 80",
        "butterworth_lowpass 16 200",
        "butterworth_highpass 1 80",
        "butterworth_highpass 4 30",
        "butterworth_highpass 7 80",
        "lowpass 100 0.707; notch 50 5; butterworth_lowpass 4 80",
        "notch 50 5; notch 100 5; notch 150 5; lead_lag 5 50; butterworth_lowpass 8 300",
    ],
)
def test_a_chain_filters_as_scipy_does(blocks: Blocks, text: str) -> None:
    out = blocks.out("Biquads", {"in": NOISE}, sections=text, settled=False)
    assert np.allclose(out, signal.sosfilt(reference(text), NOISE), rtol=0, atol=ROUNDING)


def test_a_chain_without_sections_passes_its_input(blocks: Blocks) -> None:
    assert blocks.out("Biquads", {"in": NOISE}, sections="").tolist() == NOISE.tolist()


@pytest.mark.parametrize(
    ("text", "level"),
    [
        ("lowpass 20 0.7; notch 50 5; lead_lag 5 50", 3.5),
        ("highpass 20 0.7", 0.0),
        ("bandpass 20 0.7; lowpass 50 1", 0.0),
    ],
)
def test_a_chain_begins_settled_at_its_first_value(blocks: Blocks, text: str, level: float) -> None:
    out = blocks.out("Biquads", {"in": 3.5}, steps=500, sections=text)
    assert np.allclose(out, level, rtol=0, atol=ROUNDING)


def test_a_settled_start_is_that_of_scipy(blocks: Blocks) -> None:
    text = "lowpass 100 0.707; notch 50 5"
    sections = reference(text)
    start = signal.sosfilt_zi(sections) * NOISE[0]
    expected, _ = signal.sosfilt(sections, NOISE, zi=start)
    out = blocks.out("Biquads", {"in": NOISE}, sections=text)
    assert np.allclose(out, expected, rtol=0, atol=ROUNDING)


def test_values_that_are_not_finite_leave_output_and_state_as_they_are(blocks: Blocks) -> None:
    text = "lowpass 20 0.7; notch 50 5"
    bad = np.isin(np.arange(len(NOISE)), [5, 6, 7, 100, 1500])
    values = np.where(bad, np.nan, NOISE)
    values[6], values[7] = np.inf, -np.inf
    out = blocks.out("Biquads", {"in": values}, sections=text)
    assert (out[5:8] == out[4]).all()
    assert out[~bad].tolist() == blocks.out("Biquads", {"in": NOISE[~bad]},
                                            sections=text).tolist()  # fmt: skip


def test_numbers_that_are_too_large_leave_output_and_state_as_they_are(blocks: Blocks) -> None:
    values = np.ones(50)
    values[20] = 1.7e308
    out = blocks.out("Biquads", {"in": values}, sections="lead_lag 1 100; lead_lag 1 100")
    assert np.allclose(out, 1.0, rtol=0, atol=ROUNDING)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("lowpas 100 1", "lowpas is not a section; use lowpass, highpass, bandpass, notch"),
        ("lowpass 100", "write lowpass FREQUENCY Q"),
        ("lead_lag 1 2 3", "write lead_lag ZERO_FREQUENCY POLE_FREQUENCY"),
        ("butterworth_lowpass 100", "write butterworth_lowpass ORDER FREQUENCY"),
        ("notch 50 5x", "notch: 5x is not a number"),
        ("notch 50 nan", "notch: nan is not a number"),
        ("notch 50 0", "notch: Q = 0 is not in 1e-6 to 1e6"),
        ("notch 50 -1", "notch: Q = -1 is not in 1e-6 to 1e6"),
        ("lowpass 0 1", "lowpass: 0 Hz is not between 0 and 490 Hz"),
        ("lowpass 500 1", "lowpass: 500 Hz is not between 0 and 490 Hz"),
        ("lead_lag 0 1", "lead_lag: the frequencies must be above 0 Hz"),
        ("lead_lag 1 -1", "lead_lag: the frequencies must be above 0 Hz"),
        ("butterworth_lowpass 2.5 10", "the order 2.5 is not a whole number from 1 to 16"),
        ("butterworth_lowpass 0 10", "the order 0 is not a whole number from 1 to 16"),
        ("butterworth_lowpass 17 10", "the order 17 is not a whole number from 1 to 16"),
        ("butterworth_lowpass 14 10; lowpass 1 1; lowpass 1 1", "at most 8 sections"),
    ],
)
def test_sections_that_do_not_fit_are_rejected_with_one_line(
    blocks: Blocks, text: str, said: str
) -> None:
    with rejection(said):
        blocks.set("Biquads", sections=text)


def test_an_impulse_decays_to_zero(stepped: Bench) -> None:
    block = Stepped(stepped, "Biquads", sections="lowpass 50 0.5; lowpass 20 0.5", settled=False)
    try:
        block.step(**{"in": 1.0})
        state = block.step(20000, **{"in": 0.0})
        assert state["last"] == 0.0
        assert {each for section in state["motion"] for each in section.values()} == {0.0}
    finally:
        block.unload()


@pytest.mark.parametrize(
    ("text", "level"),
    [
        ("lowpass 5 3", 1.0),
        ("highpass 50 0.707", 0.0),
        ("lowpass 10 0.707; notch 50 5; highpass 1 0.5", 0.0),
        ("notch 50 1; lead_lag 10 100; butterworth_lowpass 6 80", 1.0),
    ],
)
def test_other_sections_change_the_output_without_a_jump(
    stepped: Bench, text: str, level: float
) -> None:
    block = Stepped(stepped, "Biquads", sections="lowpass 10 0.707; notch 50 5", fade=0.1)
    try:
        block.step(10, **{"in": 1.0})
        block.set(sections=text)
        outputs = [block.step()["last_output"] for _ in range(20)]
        assert outputs[0] == pytest.approx(1.0, abs=ROUNDING)
        assert np.abs(np.diff(outputs)).max() < 0.2, "not faster than the fastest section"
        state = block.step(5000)
        assert state["last_output"] == pytest.approx(level, abs=1e-6)
        assert state["offset"] == 0.0
    finally:
        block.unload()


def test_a_redesign_while_the_input_moves_continues_from_the_expected_output(
    stepped: Bench,
) -> None:
    first, second = "lowpass 30 1; notch 50 5", "butterworth_lowpass 3 10"
    block = Stepped(stepped, "Biquads", sections=first, fade=0.2, settled=False)
    expected = signal.sosfilt(reference(first), NOISE[:60])
    try:
        for value in NOISE[:59]:
            state = block.step(**{"in": value})
        assert state["last_output"] == pytest.approx(expected[58], abs=ROUNDING)
        block.set(sections=second)
        state = block.step(**{"in": NOISE[59]})
        assert state["last_output"] == pytest.approx(expected[59], abs=ROUNDING)
    finally:
        block.unload()


def test_a_new_period_keeps_the_response(stepped: Bench) -> None:
    # A low-pass follows a ramp of 1/s with the delay 1 / (Q w) = 15.9 ms. The transform with its
    # warped frequency changes this by up to (pi 20 / 250)^2 / 3 = 2 %.
    block = Stepped(stepped, "Biquads", sections="lowpass 20 0.5", fade=0.5)
    delay = 1.0 / (0.5 * 2.0 * np.pi * 20.0)
    time = 0.0
    try:
        for _ in range(200):
            time += 0.001
            before = block.step(**{"in": time})["last_output"]
        assert time - before == pytest.approx(delay, rel=0.03)
        stepped.client.set_runner(runner_pb2.RunnerSettings(frequency_hz=250))
        lag = []
        for _ in range(100):
            time += 0.004
            after = block.step(**{"in": time})["last_output"]
            lag.append(time - after)
        assert lag[0] == pytest.approx(delay, rel=0.03), "no jump"
        assert np.allclose(lag, delay, rtol=0.06, atol=0.0)
        assert lag[-1] == pytest.approx(delay, rel=0.03)
    finally:
        block.unload()
        stepped.client.set_runner(runner_pb2.RunnerSettings(frequency_hz=1000))


# More of them: tests/unit/cpp/control/period_change_tests.cpp.
def test_a_new_period_adds_no_spike_to_the_response_to_a_wave(stepped: Bench) -> None:
    def run(other: float) -> list[float]:
        block = Stepped(stepped, "Biquads", sections="lowpass 20 5; notch 50 5")
        time, step, found = 0.0, 0.001, []
        try:
            for k in range(600):
                if k == 500:
                    stepped.client.set_runner(runner_pb2.RunnerSettings(frequency_hz=other))
                time += step
                step = 0.001 if k < 499 else 1.0 / other
                found.append(block.step(**{"in": np.sin(2.0 * np.pi * 5.0 * time)})["last_output"])
        finally:
            block.unload()
            stepped.client.set_runner(runner_pb2.RunnerSettings(frequency_hz=1000))
        return found

    found = run(500.0)
    largest = max(abs(each) for each in found[300:500])
    turn = 2.0 * np.pi * 5.0 * 0.002  # of the wave in a new period
    assert max(abs(np.diff(found[495:]))) <= 1.1 * turn * largest + 1e-6


def test_a_frequency_that_a_slower_loop_cannot_have_is_lowered_and_reported(
    stepped: Bench,
) -> None:
    block = Stepped(stepped, "Biquads", sections="lowpass 400 0.707")
    try:
        block.step(3, **{"in": 1.0})
        stepped.client.set_runner(runner_pb2.RunnerSettings(frequency_hz=100))
        assert block.step(20)["last_output"] == pytest.approx(1.0, abs=ROUNDING)
        text = "/stepped/block: 400 Hz is too high for this loop: 49 Hz instead"
        assert text in stepped.logs
    finally:
        block.unload()
        stepped.client.set_runner(runner_pb2.RunnerSettings(frequency_hz=1000))


def test_a_replacement_and_a_snapshot_continue_bit_by_bit(stepped: Bench) -> None:
    block = Stepped(stepped, "Biquads", sections="lowpass 10 0.707; notch 50 5")
    try:
        block.step(10, **{"in": 1.0})
        block.step(**{"in": 0.25})
        taken = stepped.client.take_snapshot().snapshot
        first = block.step(50)
        stepped.client.restore_snapshot(taken)
        assert block.step(50) == first
        stepped.client.restore_snapshot(taken)
        assert not stepped.client.replace("/stepped/block", block.spec()).notes
        assert block.step(50) == first
    finally:
        block.unload()

"""rtcf_control/SignalGenerator against NumPy and scipy.signal.

Tolerances: steps, squares and bits are exact. The phase of a wave is a sum of up to 5000 steps, so
waves of amplitude 1 differ from their references by less than ROUNDING; scipy's logarithmic chirp
itself rounds its phase by that much.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest
import rtcf
from block_bench import Blocks, Stepped, rejection
from hypothesis import given, seed, settings
from hypothesis import strategies as st
from rtcf.testing import Bench
from rtcf.v1 import runner_pb2
from scipy import signal

DT = 0.001
ROUNDING = 1e-9
EDGE = 1e-7  # s: a time on an edge counts as after the edge
TIME = np.arange(5000) * DT
SHAPES = (
    "step", "ramp", "sine", "square", "triangle", "linear_chirp", "log_chirp", "prbs", "multisine",
)  # fmt: skip
PERIODIC: dict[str, dict[str, Any]] = {
    "SignalGenerator": {"shape": "sine"},
    "Excitation": {"shape": "multisine", "lower": -1.0, "upper": 1.0},
}


@pytest.fixture(scope="module")
def blocks(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Blocks]:
    with Blocks(tmp_path_factory.mktemp("signals"), ["SignalGenerator"]) as blocks:
        yield blocks


def wave(blocks: Blocks, shape: str, steps: int = 5000, **parameters: Any) -> Any:
    return blocks.out("SignalGenerator", steps=steps, shape=shape, **parameters)


def test_step_and_ramp_begin_after_their_delay(blocks: Blocks) -> None:
    # 0.3 s is no sum of steps of 1 ms in floating point.
    step = wave(blocks, "step", amplitude=-2.0, offset=0.5, delay=0.3)
    assert step.tolist() == np.where(np.arange(5000) >= 300, -1.5, 0.5).tolist()
    ramp = wave(blocks, "ramp", amplitude=2.0, offset=-1.0, delay=0.3, duration=3.0)
    expected = np.interp(TIME, [0.3, 3.3], [-1.0, 1.0])
    assert np.allclose(ramp, expected, rtol=0, atol=ROUNDING)


@pytest.mark.parametrize("frequency", [0.0, 0.7, 10.0, 123.4])
def test_waves_have_their_frequency(blocks: Blocks, frequency: float) -> None:
    turn = 2.0 * np.pi * frequency
    sine = wave(blocks, "sine", frequency=frequency, amplitude=2.0, offset=0.25)
    assert np.allclose(sine, 0.25 + 2.0 * np.sin(turn * TIME), rtol=0, atol=ROUNDING)
    square = wave(blocks, "square", frequency=frequency)
    assert square.tolist() == signal.square(turn * (TIME + EDGE)).tolist()
    triangle = wave(blocks, "triangle", frequency=frequency)
    expected = signal.sawtooth(turn * TIME + np.pi / 2.0, width=0.5)
    assert np.allclose(triangle, expected, rtol=0, atol=10.0 * ROUNDING)


@pytest.mark.parametrize(("first", "last"), [(1.0, 20.0), (20.0, 1.0), (5.0, 5.0)])
@pytest.mark.parametrize("method", ["linear", "logarithmic"])
def test_chirps_sweep_and_begin_again(
    blocks: Blocks, method: str, first: float, last: float
) -> None:
    shape = "linear_chirp" if method == "linear" else "log_chirp"
    found = wave(blocks, shape, frequency=first, end_frequency=last, duration=2.0)
    once = signal.chirp(TIME[:2000], first, 2.0, last, method=method, phi=-90.0)
    assert np.allclose(found, np.concatenate([once, once, once[:1000]]), rtol=0, atol=1e-8)


def test_a_linear_chirp_may_begin_at_0(blocks: Blocks) -> None:
    found = wave(blocks, "linear_chirp", frequency=0.0, end_frequency=10.0, duration=5.0)
    assert np.allclose(found, np.sin(2.0 * np.pi * TIME**2), rtol=0, atol=1e-8)


def test_prbs_is_a_sequence_of_maximum_length(blocks: Blocks) -> None:
    bits = wave(blocks, "prbs", steps=2 * 32767, frequency=1000.0) > 0
    period = bits[:32767]
    assert (bits[32767:] == period).all()
    assert int(period.sum()) == 16384
    # The circular autocorrelation of a sequence of maximum length: -1 besides 0.
    spectrum = np.fft.rfft(np.where(period, 1.0, -1.0))
    correlation = np.fft.irfft(np.abs(spectrum) ** 2, 32767)
    assert np.allclose(correlation[1:], -1.0, rtol=0, atol=1e-6)
    # The recursion of x^15 + x^14 + 1. scipy's sequence runs backwards, from another start.
    ours = period.astype(int)
    assert (ours[15:] == (ours[:-15] ^ ours[1:-14])).all()
    theirs = signal.max_len_seq(15)[0][::-1]
    similarity = np.fft.irfft(spectrum * np.conj(np.fft.rfft(2.0 * theirs - 1.0)), 32767)
    assert (np.roll(theirs, int(np.argmax(similarity))) == ours).all()


@pytest.mark.parametrize("rate", [100.0, 300.0, 1000.0])
def test_prbs_holds_each_bit_for_its_time(blocks: Blocks, rate: float) -> None:
    fast = wave(blocks, "prbs", steps=500, frequency=1000.0)
    found = wave(blocks, "prbs", steps=500, frequency=rate)
    bit = np.floor(np.arange(500) * rate * DT + 1e-6).astype(int)
    assert found.tolist() == fast[bit].tolist()


@pytest.mark.parametrize("lines", [1, 2, 10, 64])
def test_multisine_has_equal_lines_and_its_amplitude_as_peak(blocks: Blocks, lines: int) -> None:
    found = wave(blocks, "multisine", steps=1000, frequency=1.0, lines=lines, amplitude=3.0)
    spectrum = np.abs(np.fft.rfft(found)) / 500.0
    assert np.allclose(spectrum[1 : lines + 1], spectrum[1], rtol=1e-3, atol=0)
    assert np.allclose(spectrum[lines + 1 :], 0.0, rtol=0, atol=1e-3)
    assert np.max(np.abs(found)) <= 3.0
    # The peak lies between two samples.
    assert np.max(np.abs(signal.resample(found, 100_000))) == pytest.approx(3.0, rel=1e-3)
    # Schroeder's phases: less than 2.1 times the RMS value.
    assert spectrum[1] * np.sqrt(lines / 2.0) > 3.0 / 2.1


@seed(29)
@settings(max_examples=15)
@given(
    shape=st.sampled_from(SHAPES),
    amplitude=st.floats(-10.0, 10.0),
    offset=st.floats(-10.0, 10.0),
    frequency=st.floats(0.01, 49.0),  # 10 lines of it are below 500 Hz
    limits=st.tuples(st.floats(-5.0, 5.0), st.floats(-5.0, 5.0)),
)
def test_each_signal_stays_within_its_amplitude_and_limits(
    blocks: Blocks,
    shape: str,
    amplitude: float,
    offset: float,
    frequency: float,
    limits: tuple[float, float],
) -> None:
    lower, upper = sorted(limits)
    free = wave(blocks, shape, steps=300, amplitude=amplitude, offset=offset, frequency=frequency)
    assert np.max(np.abs(free - offset)) <= abs(amplitude) * (1.0 + 1e-12) + 1e-12
    found = wave(blocks, shape, steps=300, amplitude=amplitude, offset=offset,
                 frequency=frequency, lower=lower, upper=upper)  # fmt: skip
    assert found.tolist() == np.clip(free, lower, upper).tolist()


@pytest.mark.parametrize("shape", SHAPES)
def test_a_signal_that_is_enabled_begins_anew(blocks: Blocks, shape: str) -> None:
    parameters: dict[str, Any] = {"offset": 0.5, "frequency": 40.0}
    free = wave(blocks, shape, steps=40, **parameters)
    enable = (np.arange(80) >= 10) & (np.arange(80) < 30) | (np.arange(80) >= 40)
    found = blocks.out("SignalGenerator", {"enable": enable}, shape=shape, **parameters)
    assert (found[~enable] == 0.5).all()
    assert found[10:30].tolist() == free[:20].tolist()
    assert found[40:].tolist() == free.tolist()


def test_a_signal_can_wait_for_enable(blocks: Blocks) -> None:
    enable = np.ma.array(np.ones(5, bool), mask=np.arange(5) < 3)  # type: ignore[no-untyped-call]
    found = blocks.out("SignalGenerator", {"enable": enable}, shape="step", enabled=False)
    assert found.tolist() == [0.0, 0.0, 0.0, 1.0, 1.0]


@pytest.mark.parametrize(
    ("parameters", "said"),
    [
        ({"lower": 2.0, "upper": 1.0}, "lower = 2 is above upper = 1"),
        (
            {"shape": "log_chirp", "frequency": 0.0},
            "log_chirp: frequency and end_frequency must be above 0 Hz",
        ),
        ({"lines": 65}, "lines"),
        ({"duration": 0.0}, "duration"),
        ({"frequency": -1.0}, "frequency"),
    ],
)
def test_parameters_that_do_not_fit_are_rejected_with_one_line(
    blocks: Blocks, parameters: dict[str, Any], said: str
) -> None:
    with rejection(said):
        blocks.set("SignalGenerator", **parameters)


def test_another_frequency_continues_the_phase(stepped: Bench) -> None:
    block = Stepped(stepped, "SignalGenerator", frequency=2.0)
    try:
        before = block.step(100)["phase"]
        block.set(frequency=5.0)
        assert block.step()["phase"] == pytest.approx(before + 0.005, abs=ROUNDING)
    finally:
        block.unload()


@pytest.mark.parametrize("shape", ["log_chirp", "prbs"])
def test_a_signal_continues_bit_by_bit_from_a_snapshot(stepped: Bench, shape: str) -> None:
    block = Stepped(stepped, "SignalGenerator", shape=shape, frequency=33.0)
    try:
        block.step(57)
        taken = stepped.client.take_snapshot().snapshot
        first = block.step(70)
        stepped.client.restore_snapshot(taken)
        assert block.step(70) == first
        assert not stepped.client.replace("/stepped/block", block.spec()).notes
        assert block.state == first
        stepped.client.reset_state("/stepped/block")
        assert block.state["time"] == 0
    finally:
        block.unload()


def test_a_stop_writes_the_offset(stepped: Bench) -> None:
    client = stepped.client
    for spec in (
        rtcf.component("rtcf_control", "SignalGenerator", ns="/end", name="source",
                       parameters=["shape:=step", "offset:=0.5"]),
        rtcf.component("rtcf_control", "RateLimiter", ns="/end", name="limiter",
                       remaps=["in:=/end/out", "out:=/end/limited_out"]),
    ):  # fmt: skip
        client.load(spec)
    try:
        client.start()
        client.stop()
        (last,) = (each for each in client.get_component("/end/limiter").states
                   if each.name == "last")  # fmt: skip
        assert float(last.value) == 0.5
    finally:
        client.unload(["/end/source", "/end/limiter"])


@pytest.mark.parametrize("bits", [100, 200, 400, 1000])
def test_the_first_bits_of_prbs_have_a_small_mean(blocks: Blocks, bits: int) -> None:
    found = wave(blocks, "prbs", steps=bits, frequency=1000.0)
    assert abs(found.mean()) <= 1.0 / np.sqrt(bits)


@pytest.mark.parametrize(
    ("parameters", "said"),
    [
        ({"shape": "sine", "frequency": 500.0}, "500 Hz, is not below 500 Hz"),
        ({"shape": "square", "frequency": 501.0}, "501 Hz, is not below 500 Hz"),
        ({"shape": "triangle", "frequency": 900.0}, "900 Hz, is not below 500 Hz"),
        ({"shape": "linear_chirp", "end_frequency": 800.0}, "800 Hz, is not below 500 Hz"),
        ({"shape": "log_chirp", "frequency": 600.0}, "600 Hz, is not below 500 Hz"),
        ({"shape": "multisine", "lines": 64, "frequency": 20.0}, "1280 Hz, is not below 500 Hz"),
    ],
)
def test_frequencies_that_alias_are_rejected_with_one_line(
    stepped: Bench, parameters: dict[str, Any], said: str
) -> None:
    with rejection(said):
        Stepped(stepped, "SignalGenerator", **parameters)
    if parameters["shape"] in ("sine", "square", "triangle"):
        return
    with rejection(said):
        Stepped(stepped, "Excitation", **parameters)
    block = Stepped(stepped, "Excitation")
    try:
        with rejection(said):
            block.set(**parameters)
    finally:
        block.unload()


def test_a_square_wave_may_change_its_sign_in_each_cycle(blocks: Blocks) -> None:
    assert wave(blocks, "square", steps=4, frequency=500.0).tolist() == [1.0, -1.0, 1.0, -1.0]


def test_more_bits_than_cycles_are_reported(stepped: Bench) -> None:
    block = Stepped(stepped, "SignalGenerator", shape="prbs", frequency=2500.0)
    try:
        block.step(3)
        said = "a PRBS of 2500 bits per second has one bit per cycle, 1000 per second: lower "
        assert sum(said in line for line in stepped.logs) == 1
    finally:
        block.unload()


def test_a_slower_loop_reports_a_frequency_that_aliases_once(stepped: Bench) -> None:
    block = Stepped(stepped, "SignalGenerator", shape="sine", frequency=400.0)
    try:
        block.step(3)
        stepped.client.set_runner(runner_pb2.RunnerSettings(frequency_hz=500))
        block.step(20)
        text = [line for line in stepped.logs if "400 Hz, is not below 250 Hz" in line]
        assert len(text) == 1
        block.set(amplitude=0.0)  # other parameters can still change
        with rejection("401 Hz, is not below 250 Hz"):
            block.set(frequency=401.0)
    finally:
        block.unload()
        stepped.client.set_runner(runner_pb2.RunnerSettings(frequency_hz=1000))


@pytest.mark.parametrize("other", [500.0, 4000.0])
@pytest.mark.parametrize("type_", ["SignalGenerator", "Excitation"])
def test_the_phase_continues_at_another_frequency_of_the_loop(
    stepped: Bench, type_: str, other: float
) -> None:
    block = Stepped(stepped, type_, frequency=5.0, **PERIODIC[type_])
    try:
        if type_ == "Excitation":
            block.step(**{"run": False, "in": 0.0})
            block.step(**{"run": True})
        before = block.step(10)["phase"]
        stepped.client.set_runner(runner_pb2.RunnerSettings(frequency_hz=other))
        found = [before] + [block.step()["phase"] for _ in range(3)]
        assert np.allclose(np.diff(found), 5.0 / other, rtol=0, atol=ROUNDING)
    finally:
        block.unload()
        stepped.client.set_runner(runner_pb2.RunnerSettings(frequency_hz=1000))

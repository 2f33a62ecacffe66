"""`rtcfctl identify` on simulated motors: models, gains, drawings, rejections, and safe ends.

Tolerances: the motors are linear and without noise, so gain and time constant are found within 2 %
(MODEL), poles within 3 % (POLES). A lag turns a relay's square wave into a triangle, so that the
describing function finds 8 / pi² of the ultimate gain, within 5 % (RELAY).
"""

from __future__ import annotations

import json
import signal
import subprocess
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import rtcf
import yaml
from daemon_process import BUILD_TREE, Daemon, wait_for, wait_until_it_is
from motors import LAG, gains, load
from values import iteration

MODEL, POLES, RELAY = 0.02, 0.03, 0.05
SOFT = {"inertia": 1e-4, "load_inertia": 4e-4, "stiffness": 5.0, "damping": 2e-3, "viscous": 1e-3}
LIMITS = ("--lower", "-0.1", "--upper", "0.1")
LEASE_ENDED = 5


def motor(client: rtcf.Client, **parameters: Any) -> None:
    load(client, "Motor", "motor", **parameters)


def identify(daemon: Daemon, *words: str) -> Any:
    """Return the result of an identification in steps."""
    done = daemon.ctl("identify", *words, "--step", "--output", "json")
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)


def test_a_lag_is_found_with_stable_gains(daemon: Daemon, client: rtcf.Client) -> None:
    motor(client, **LAG)
    found = identify(daemon, "motor.command", "motor.velocity", *LIMITS, "--closed-loop-time",
                     "0.1")  # fmt: skip
    assert found["first_order"]["gain"] == pytest.approx(500.0, rel=MODEL)
    assert found["first_order"]["denominator"][0] == pytest.approx(0.5, rel=MODEL)
    assert found["first_order"]["delay"] < 1e-3
    assert found["first_order"]["fit"] > 99.0
    assert found["interpolated"] == 0
    # SIMC: Kc = T / (K (tc + delay)), with half a period as the delay.
    assert found["gains"]["kp"] == pytest.approx(0.5 / 500.0 / 0.1005, rel=2 * MODEL)
    assert found["margins"]["stable"]
    assert found["margins"]["phase"] > 60.0


def test_a_delay_is_found(daemon: Daemon, client: rtcf.Client) -> None:
    load(client, "Delay", "delay", {"in": "/wanted", "out": "/effort"}, delay=0.05)
    load(client, "Motor", "motor", {"command": "/effort"}, **LAG)
    found = identify(daemon, "delay.in", "motor.velocity", *LIMITS)
    assert found["first_order"]["gain"] == pytest.approx(500.0, rel=MODEL)
    assert found["first_order"]["delay"] == pytest.approx(0.05, abs=1e-3)
    # The default method.
    assert found["method"] == "simc"
    assert found["margins"]["sensitivity"] < 2.0


def test_the_resonance_of_an_elastic_load_is_found(daemon: Daemon, client: rtcf.Client) -> None:
    motor(client, **SOFT)
    found = identify(daemon, "motor.command", "motor.velocity", *LIMITS, "--shape", "chirp",
                     "--frequency", "0.2", "--end-frequency", "200")  # fmt: skip
    space = found["state_space"]
    assert space["fit"] > 95.0
    # The characteristic polynomial of the two inertias, without the position.
    names = ("inertia", "load_inertia", "stiffness", "damping", "viscous")
    j, load_j, k, d, b = (SOFT[name] for name in names)
    expected = np.roots(
        [
            j * load_j,
            (j + load_j) * d + load_j * b,
            (j + load_j) * k + b * d,
            b * k,
        ]
    )
    poles = [each["real"] + 1j * each["imaginary"] for each in space["poles"]]
    for pole in expected[np.abs(expected.imag) > 0]:
        assert min(abs(np.array(poles) - pole)) < POLES * abs(pole)


@pytest.mark.parametrize("shape", ["prbs", "step", "multisine"])
def test_each_shape_finds_the_lag(daemon: Daemon, client: rtcf.Client, shape: str) -> None:
    motor(client, **LAG)
    found = identify(daemon, "motor.command", "motor.velocity", *LIMITS, "--shape", shape)
    assert found["first_order"]["gain"] == pytest.approx(500.0, rel=MODEL)
    assert found["first_order"]["denominator"][0] == pytest.approx(0.5, rel=MODEL)


def test_a_relay_finds_the_oscillation(daemon: Daemon, client: rtcf.Client) -> None:
    load(client, "Delay", "delay", {"in": "/wanted", "out": "/effort"}, delay=0.05)
    load(client, "Motor", "motor", {"command": "/effort"}, **LAG)
    found = identify(daemon, "delay.in", "motor.velocity", *LIMITS, "--shape", "relay")
    # The phase of the lag and its delay is -180 degrees at this frequency.
    omega = np.linspace(1.0, 100.0, 200_000)
    phase = -np.arctan(0.5 * omega) - 0.0515 * omega
    ultimate = float(np.interp(np.pi, -phase, omega))
    gain = float(np.hypot(1.0, 0.5 * ultimate)) / 500.0
    assert found["relay"]["ultimate_period"] == pytest.approx(2 * np.pi / ultimate, rel=RELAY)
    assert found["relay"]["ultimate_gain"] == pytest.approx(8.0 / np.pi**2 * gain, rel=RELAY)
    assert found["method"] == "relay"
    assert found["margins"]["stable"]


def test_plots_and_the_command_for_the_gains_are_printed(
    daemon: Daemon, client: rtcf.Client
) -> None:
    motor(client, **LAG)
    client.write("motor.command", 0.02)
    for name in ("drawing.svg", "drawing.png"):
        client.step(5000)  # to rest
        file = daemon.folder / name
        done = daemon.ctl("identify", "motor.command", "motor.velocity", *LIMITS, "--step",
                          "--closed-loop-time", "0.1", "-o", str(file))  # fmt: skip
        assert done.returncode == 0, done.stderr
        for text in ("first order", "second order", "state space", "gain in dB", "phase in degrees",
                     "step response", "residuals", "phase margin",
                     "rtcfctl set PID kp:="):  # fmt: skip
            assert text in done.stdout
        assert "⣀" in done.stdout
    assert "residuals" in (daemon.folder / "drawing.svg").read_text()
    assert (daemon.folder / "drawing.png").read_bytes().startswith(b"\x89PNG")
    # Nothing has changed.
    assert client.get_order() == ["/motor"]
    assert daemon.ctl("get", "motor.command").stdout == "0.02\n"


def test_an_excitation_in_a_closed_loop_keeps_its_parameters(
    daemon: Daemon, client: rtcf.Client
) -> None:
    load(client, "Pid", "pid", {"measured": "/speed", "effort": "/wanted", "setpoint": "/goal"},
         breaks=["measured"], kp=0.004, ki=0.01)  # fmt: skip
    load(client, "Excitation", "excitation",
         {"in": "/wanted", "out": "/effort", "measured": "/speed"},
         breaks=["measured"], amplitude=0.03, lower=-0.07, upper=0.07)  # fmt: skip
    load(client, "Motor", "motor", {"command": "/effort", "velocity": "/speed"}, **LAG)
    client.write("pid.setpoint", 10.0)
    client.step(3000)
    before = client.get_component("excitation").parameters
    done = daemon.ctl("identify", "excitation", *LIMITS, "--amplitude", "0.02", "--step",
                      "--closed-loop-time", "0.1", "--apply", "pid")  # fmt: skip
    assert done.returncode == 0, done.stderr
    assert client.get_component("excitation").parameters == before
    assert gains(client)["kp"] == pytest.approx(0.00995, rel=0.1)
    assert "`rtcfctl undo pid` reverts it" in done.stdout
    assert daemon.ctl("undo", "pid").returncode == 0
    assert gains(client)["kp"] == 0.004


RESONANCE = {"A": "0 1; -400 -4", "B": "0; 400", "C": "1 0"}  # 20 rad/s, damping 0.1


def test_the_notch_for_a_resonance_permits_the_gains_for_it(
    daemon: Daemon, client: rtcf.Client
) -> None:
    load(client, "StateSpace", "plant", {"in1": "/command", "out1": "/y"}, **RESONANCE)
    words = ("plant.in1", "plant.out1", "--lower", "-1", "--upper", "1")
    found = identify(daemon, *words)
    assert found["resonance"]["frequency"] == pytest.approx(20.0 / (2.0 * np.pi), rel=MODEL)
    assert found["resonance"]["damping"] == pytest.approx(0.1, rel=MODEL)
    notch = found["notch"]
    client.step(8000)  # to rest
    printed = daemon.ctl("identify", *words, "--step").stdout
    assert f'--param sections:="{notch["sections"]}"' in printed
    assert "resonance at 3.183 Hz, damping 0.1" in printed
    # With both, a step of the setpoint settles.
    client.step(8000)
    load(client, "Biquads", "notch", {"in": "/effort", "out": "/command"},
         sections=notch["sections"])  # fmt: skip
    load(client, "Pid", "pid", {"measured": "/y", "effort": "/effort"}, breaks=["measured"],
         **notch["gains"])  # fmt: skip
    client.write("pid.setpoint", 1.0)
    client.step(15000)
    assert float(value(daemon, "plant.out1")) == pytest.approx(1.0, abs=1e-3)


def test_a_controller_of_another_rate_is_refused(daemon: Daemon, client: rtcf.Client) -> None:
    motor(client, **LAG)
    client.load(rtcf.component("rtcf_control", "Pid", name="pid", every=4))
    done = daemon.ctl("identify", "motor.command", "motor.velocity", *LIMITS, "--step", "--apply",
                      "pid")  # fmt: skip
    assert done.returncode == 1
    assert "--apply pid: it runs once in 4 cycles" in done.stderr
    assert len(done.stderr.splitlines()) == 1


@pytest.mark.parametrize("kind", ["json", "yaml"])
def test_a_plant_that_is_not_described_has_no_gains(
    daemon: Daemon, client: rtcf.Client, kind: str
) -> None:
    # The measured value is another signal than the answer of the motor.
    motor(client, **LAG)
    load(client, "SignalGenerator", "source", {"out": "/other"}, shape="prbs", frequency=333.0)
    load(client, "Pid", "pid", kp=0.004, ki=0.01)
    words = ("identify", "motor.command", "source.out", *LIMITS, "--step", "--output", kind)
    done = daemon.ctl(*words)
    assert done.returncode == 0, done.stderr
    found = yaml.safe_load(done.stdout)  # JSON is YAML
    assert found["gains"] is None and found["margins"] is None
    assert "50 % are needed" in found["reason"]
    assert "Infinity" not in done.stdout and "NaN" not in done.stdout
    done = daemon.ctl(*words, "--apply", "pid")
    assert done.returncode == 1
    assert done.stderr.startswith("rtcfctl: no gains: the best model describes ")
    assert done.stderr.endswith("; pid keeps its gains\n")
    assert gains(client) == {"kp": 0.004, "ki": 0.01}


def test_a_limit_of_the_output_ends_it(daemon: Daemon, client: rtcf.Client) -> None:
    motor(client, **LAG)
    client.write("motor.command", 0.01)
    done = daemon.ctl("identify", "motor.command", "motor.velocity", *LIMITS, "--step",
                      "--shape", "step", "--measured-upper", "20")  # fmt: skip
    assert (done.returncode, done.stdout) == (1, "")
    assert done.stderr.startswith(
        "rtcfctl: the excitation by /excitation ended early: the measured value left its limits"
    )
    assert client.get_order() == ["/motor"]
    assert daemon.ctl("get", "motor.command").stdout == "0.01\n"


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["motor.command", *LIMITS], "motor.command: name the measured output, too"),
        (["motor.torque", "motor.velocity", *LIMITS], "/motor has no input torque (inputs:"),
        (["motor.command", "motor.speedy", *LIMITS], "/motor has no output speedy"),
        (["motor", "motor.velocity", *LIMITS], "/motor is no rtcf_control/Excitation: use one, or"),
        (["taken.in", "motor.velocity", *LIMITS], "/source/out"),
        (["motor.command", "motor.velocity", "--lower", "1", "--upper", "0"],
         "--lower 1: must be below --upper 0"),
        (["motor.command", "motor.velocity", *LIMITS, "--measured-lower", "1", "--measured-upper",
          "1"], "--measured-lower 1: must be below --measured-upper 1"),
        (["motor.command", "motor.velocity", "--lower", "1", "--upper", "2"], "it did not begin"),
        (["motor.command", "motor.velocity", *LIMITS, "--duration", "0"], "--duration 0: more"),
        (["motor.command", "motor.velocity", *LIMITS, "--frequency", "-1"], "--frequency -1: more"),
        (["motor.command", "motor.velocity", *LIMITS, "--hysteresis", "-1"], "--hysteresis -1: 0"),
        (["motor.command", "motor.velocity", *LIMITS, "--method", "relay"],
         "--method relay requires --shape relay"),
        (["motor.command", "motor.velocity", *LIMITS, "--apply", "motor"],
         "--apply motor: it has no parameters kp, ki and kd"),
        (["motor.command", "motor.velocity", *LIMITS, "-o", "plot.pdf"],
         "plot.pdf: use one of .svg, .png"),
        (["motor.command", "motor.velocity", *LIMITS, "--order", "9"], "order 9: 0 to 8"),
        (["motor.command", "motor.velocity", *LIMITS, "--amplitude", "0", ],
         "the input is constant: no model"),
    ],
)  # fmt: skip
def test_what_cannot_be_identified_is_rejected_with_one_line(
    daemon: Daemon, client: rtcf.Client, words: list[str], said: str
) -> None:
    motor(client, **LAG)
    client.load(rtcf.component("rtcf_control", "SignalGenerator", name="source", ns="/source"))
    load(client, "Gain", "taken", {"in": "/source/out", "out": "/taken"})
    order = client.get_order()
    done = daemon.ctl("identify", "--duration", "1", *words, "--step")
    assert done.returncode in (1, 2), done.stdout
    assert said in done.stderr
    assert len(done.stderr.splitlines()) == 1
    assert client.get_order() == order


def test_it_asks_for_a_running_loop_or_for_steps(daemon: Daemon, client: rtcf.Client) -> None:
    motor(client, **LAG)
    done = daemon.ctl("identify", "motor.command", "motor.velocity", *LIMITS)
    assert done.returncode == 1
    assert "the loop of rt_runner does not run: `rtcfctl -r rt_runner start`, or" in done.stderr
    client.start()
    done = daemon.ctl("identify", "motor.command", "motor.velocity", *LIMITS, "--step")
    assert done.returncode == 1
    assert "the loop of rt_runner runs: omit --step, or stop it first" in done.stderr
    client.stop()


def begin(daemon: Daemon, client: rtcf.Client) -> subprocess.Popen[bytes]:
    """Begin an identification of a minute in a running loop."""
    motor(client, **LAG)
    client.write("motor.command", 0.0125)
    client.start()
    process = subprocess.Popen(
        [BUILD_TREE / "bin" / "rtcfctl", "identify", "motor.command",
         "motor.velocity", *LIMITS, "--duration", "60", "--shape", "step"],
        env=daemon.environment(), stdin=subprocess.DEVNULL,
        stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
    )  # fmt: skip
    wait_for(lambda: value(daemon, "motor.command") == "0.1", "the excitation")
    return process


def value(daemon: Daemon, name: str) -> str:
    return daemon.ctl("get", name).stdout.strip()


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
def test_ctrl_c_and_termination_end_it_at_once(
    daemon: Daemon, client: rtcf.Client, number: signal.Signals
) -> None:
    process = begin(daemon, client)
    process.send_signal(number)
    assert process.wait(60) == 1
    assert client.get_order() == ["/motor"]
    wait_for(lambda: value(daemon, "motor.command") == "0.0125", "the command before")
    client.stop()


def test_a_killed_caller_ends_it(daemon: Daemon, client: rtcf.Client) -> None:
    process = begin(daemon, client)
    process.kill()
    process.wait()
    wait_until_it_is(["/motor"], client.get_order, "the order")
    assert value(daemon, "motor.command") == "0.0125"
    cycles = iteration(client)
    wait_for(lambda: iteration(client) > cycles, "the loop to go on")
    client.stop()


def test_a_lost_connection_ends_it(daemon: Daemon, client: rtcf.Client) -> None:
    process = begin(daemon, client)
    daemon.end(signal.SIGKILL)
    daemon.start()
    assert process.wait(60) == 3
    wait_until_it_is("0.0125", lambda: value(daemon, "motor.command"), "the command before")
    assert value(daemon, "excitation.state") == str(LEASE_ENDED)
    with rtcf.Client(daemon.socket) as again:
        wait_until_it_is(["/motor"], again.get_order, "the order")
    assert daemon.ctl("stop").returncode == 0


def test_without_scipy_it_names_the_package(
    daemon: Daemon, client: rtcf.Client, tmp_path: Path
) -> None:
    motor(client, **LAG)
    (tmp_path / "scipy.py").write_text("raise ImportError\n")
    program = (
        "import sys; sys.path[:0] = sys.argv.pop(1).split(':'); from rtcfctl.main import main; "
        "sys.exit(main())"
    )
    path = f"{tmp_path}:{BUILD_TREE / 'python'}"
    done = daemon.run("/usr/bin/python3", "-I", "-c", program, path, "identify", "motor.command",
                      "motor.velocity", *LIMITS, "--step")  # fmt: skip
    assert done.stderr == ("rtcfctl: identification needs SciPy: sudo apt install python3-scipy\n")
    assert done.returncode == 1


def test_an_excitation_that_does_not_begin_is_reported(daemon: Daemon, client: rtcf.Client) -> None:
    load(client, "Excitation", "excitation", {"out": "/effort", "measured": "/speed"},
         breaks=["measured"])  # fmt: skip
    load(client, "Motor", "motor", {"command": "/effort", "velocity": "/speed"}, **LAG)
    client.write("excitation.stop", True)
    done = daemon.ctl("identify", "excitation", *LIMITS, "--step")
    assert done.returncode == 1
    assert done.stderr == ("rtcfctl: the excitation does not begin: is its input stop true?\n")

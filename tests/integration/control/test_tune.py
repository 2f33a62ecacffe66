"""`rtcfctl tune` on a simulated motor: closed-loop steps before and after a change, and undo."""

from __future__ import annotations

import json
import signal
import subprocess

import pytest
import rtcf
from daemon_process import DEADLINE_S, Daemon, wait_for, wait_until_it_is
from motors import LAG, gains, load

TUNE = ("tune", "pid", "--lower", "0", "--upper", "50", "--size", "5", "--duration", "2", "--step")
SLOW = {"kp": 0.002, "ki": 0.02}


@pytest.fixture
def controlled(daemon: Daemon, client: rtcf.Client) -> Daemon:
    """Return a daemon with a controlled motor at 10 rad/s."""
    load(client, "Pid", "pid", {"measured": "/speed", "effort": "/wanted", "setpoint": "/goal"},
         breaks=["measured"], **SLOW)  # fmt: skip
    load(client, "Motor", "motor", {"command": "/wanted", "velocity": "/speed"}, **LAG)
    client.write("pid.setpoint", 10.0)
    client.step(5000)
    return daemon


def test_faster_gains_are_compared_and_kept(controlled: Daemon, client: rtcf.Client) -> None:
    done = controlled.ctl(*TUNE, "--param", "kp:=0.01", "--param", "ki:=0.02", "--output", "json")
    assert done.returncode == 0, done.stderr
    found = json.loads(done.stdout)
    # With ki / kp = 1 / T, the closed loop is a lag of T / (K kp): 0.1 s, 5 % after 3 of it.
    assert found["after"]["rise_time"] == pytest.approx(2.2 * 0.1, rel=0.02)
    assert found["after"]["settling_time"] == pytest.approx(3.0 * 0.1, rel=0.02)
    assert found["after"]["overshoot"] < 0.01
    assert found["before"]["overshoot"] > 0.2
    assert gains(client) == {"kp": 0.01, "ki": 0.02}
    assert client.get_order() == ["/pid", "/motor"]
    assert controlled.ctl("get", "pid.setpoint").stdout == "10\n"
    assert controlled.ctl("undo", "pid").returncode == 0
    assert gains(client) == SLOW


def test_the_comparison_is_printed_with_both_steps(controlled: Daemon, client: rtcf.Client) -> None:
    done = controlled.ctl(*TUNE, "--param", "kp:=0.01", "--undo")
    assert done.returncode == 0, done.stderr
    for text in ("before", "after", "rise time", "settling time", "overshoot", "final error",
                 "reverted kp:=0.01 of /pid"):  # fmt: skip
        assert text in done.stdout
    assert done.stdout.count("0 s ") >= 2
    assert gains(client) == SLOW
    assert "`rtcfctl undo /pid` reverts it" in controlled.ctl(*TUNE, "--param", "kp:=0.01").stdout


def test_without_parameters_it_only_measures(controlled: Daemon, client: rtcf.Client) -> None:
    done = controlled.ctl(*TUNE, "--output", "json")
    assert list(json.loads(done.stdout)) == ["before"]
    assert "now" in controlled.ctl(*TUNE).stdout
    assert gains(client) == SLOW


def test_a_step_that_leaves_its_limits_is_undone(controlled: Daemon, client: rtcf.Client) -> None:
    done = controlled.ctl(
        *TUNE, "--param", "kp:=0.0002", "--param", "ki:=0.1", "--measured-upper", "16.5"
    )
    assert done.returncode == 1
    assert done.stderr == (
        "rtcfctl: the excitation by /excitation ended early: the measured value left its limits or "
        "was lost, or a value was not finite; the parameters were set back\n"
    )
    assert gains(client) == SLOW
    assert controlled.ctl("get", "pid.setpoint").stdout == "10\n"


@pytest.mark.parametrize("output", [(), ("--output", "json")])
def test_a_worse_step_is_undone_and_fails(
    controlled: Daemon, client: rtcf.Client, output: tuple[str, ...]
) -> None:
    done = controlled.ctl(*TUNE, "--param", "kp:=0.0002", *output)
    assert done.returncode == 1
    assert len(done.stderr.splitlines()) == 1
    assert done.stderr.startswith("rtcfctl: after is worse: ")
    assert done.stderr.endswith(": the parameters of /pid were set back\n")
    assert "its ITAE is " in done.stderr
    assert "overshoot" in done.stdout
    if output:
        assert json.loads(done.stdout)["after"]["settling_time"] is None
    assert gains(client) == SLOW


@pytest.mark.parametrize(
    ("number", "code"),
    [(signal.SIGINT, 1), (signal.SIGTERM, 1), (signal.SIGHUP, 1), (signal.SIGKILL, -9)],
)
def test_the_gains_are_set_back_if_it_ends_early(
    controlled: Daemon, client: rtcf.Client, number: signal.Signals, code: int
) -> None:
    client.start()
    words = (*TUNE[:-1], "--param", "kp:=0.01", "--duration", "4")
    with subprocess.Popen(
        ["rtcfctl", *words],
        env=controlled.environment(), stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
    ) as process:  # fmt: skip
        wait_for(lambda: gains(client) != SLOW, "the new gains")
        process.send_signal(number)
        said = process.communicate(timeout=DEADLINE_S)[1]
    assert process.returncode == code
    assert ("interrupted" in said) == (code == 1)
    wait_until_it_is(SLOW, lambda: gains(client), "the gains")
    wait_until_it_is(["/pid", "/motor"], client.get_order, "the order")
    assert controlled.ctl("get", "pid.setpoint").stdout == "10\n"


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["--size", "0"], "--size 0: a number other than 0"),
        (["--tolerance", "1"], "--tolerance 1: between 0 and 1"),
        (["--duration", "0"], "--duration 0: more than 0"),
        (["--undo"], "--undo requires --param"),
        (["--upper", "12"], "the limits leave 2 of the step of 5: set wider limits, or a smaller"),
        (["--param", "kp:=fast"], "kp"),
        (["--input", "pid.manual"], "types differ on /manual"),
        (["--input", "motor.command"], "/wanted"),
        (["--measured", "motor.speedy"], "/motor has no output speedy"),
    ],
)
def test_what_cannot_be_tuned_is_rejected_with_one_line(
    controlled: Daemon, client: rtcf.Client, words: list[str], said: str
) -> None:
    client.write("pid.manual", False)
    done = controlled.ctl(*TUNE, *words)
    assert done.returncode in (1, 2), done.stdout
    assert said in done.stderr
    assert len(done.stderr.splitlines()) == 1
    assert gains(client) == SLOW
    assert client.get_order() == ["/pid", "/motor"]


def test_a_controller_without_a_measured_value_is_rejected(
    daemon: Daemon, client: rtcf.Client
) -> None:
    load(client, "Pid", "pid", {"setpoint": "/goal"})
    done = daemon.ctl(*TUNE)
    assert done.returncode == 1
    assert "no output is connected to /pid.measured (/measured): connect it, or name" in done.stderr

"""State declared by components: shown, kept by a replacement, reset."""

import json
from typing import Any

import rtcf
from daemon_process import Daemon


def _wave(name: str = "wave") -> Any:
    return rtcf.component("rtcf_examples", "Wave", name=name, parameters=["rate:=1.0"])


def _phase(daemon: Daemon) -> float:
    shown = json.loads(daemon.ctl("info", "wave", "-o", "json").stdout)
    (phase,) = (each for each in shown["states"] if each["name"] == "phase")
    assert phase["type"] == "double"
    return float(phase["value"])


def test_state_is_shown_kept_and_reset(daemon: Daemon, client: rtcf.Client) -> None:
    client.load(_wave())
    client.step(250)
    assert abs(_phase(daemon) - 0.25) < 1e-6
    assert "of the wave, from 0 to 1" in daemon.ctl("info", "wave").stdout
    assert not client.replace("wave", _wave()).notes
    assert abs(_phase(daemon) - 0.25) < 1e-6
    done = daemon.ctl("reset", "wave")
    assert done.returncode == 0, done.stderr
    assert _phase(daemon) == 0.0
    client.step(100)
    assert abs(_phase(daemon) - 0.1) < 1e-6


def test_a_replacement_reports_state_that_it_does_not_keep(
    daemon: Daemon, client: rtcf.Client
) -> None:
    client.load(_wave())
    done = daemon.ctl("replace", "wave", "rtcf_examples", "Identity")
    assert done.returncode == 0, done.stderr
    assert "rtcfctl: note: gone from /wave: states phase, above\n" in done.stderr


def test_a_component_without_state_cannot_be_reset(daemon: Daemon, client: rtcf.Client) -> None:
    client.load(rtcf.component("rtcf_examples", "Identity", name="plain"))
    done = daemon.ctl("reset", "plain")
    assert done.returncode != 0
    assert "/plain declares no state" in done.stderr
    assert daemon.ctl("reset", "nobody").returncode != 0


def test_state_is_set_while_the_loop_does_not_run(daemon: Daemon, client: rtcf.Client) -> None:
    client.load(_wave())
    client.step(10)
    done = daemon.ctl("set", "wave.state", "phase:=0.75")
    assert done.returncode == 0, done.stderr
    assert _phase(daemon) == 0.75
    client.step(1)
    assert abs(_phase(daemon) - 0.751) < 1e-6
    for words, why in (
        (("wave.state", "phase:=much"), "state phase of /wave takes values of type double"),
        (("wave.state", "fase:=1.0"), "/wave declares no state fase"),
        (("wave.parameter", "rate:=1.0"), "wave.state"),
        (("nobody.state", "phase:=1.0"), "nobody"),
    ):
        done = daemon.ctl("set", *words)
        assert done.returncode != 0
        assert why in done.stderr
    client.start()
    done = daemon.ctl("set", "wave.state", "phase:=0.5")
    assert done.returncode == 1
    assert "stop it to set state" in done.stderr

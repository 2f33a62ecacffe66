"""Installed completion: it offers existing names and does not start rtcfd."""

import shlex

import pytest
from machine import wait_for
from rtcf_service import Service


def completed(service: Service, line: str) -> list[str]:
    """Return bash's completions of the last word of a line."""
    words = line.split(" ")
    script = (
        "source /usr/share/bash-completion/completions/rtcfctl; "
        f"COMP_WORDS=({' '.join(map(shlex.quote, words))}); COMP_CWORD={len(words) - 1}; "
        # Not a prompt, so a completion has no options.
        "compopt() { :; }; _rtcfctl; printf '%s\\n' \"${COMPREPLY[@]}\""
    )
    return service.machine.shell(script, user="alice").stdout.split()


@pytest.mark.parametrize(
    ("line", "offered"),
    [
        ("rtcfctl info wa", ["wave"]),
        ("rtcfctl load rtcf_ex", ["rtcf_examples"]),
        ("rtcfctl set wave amp", ["amplitude:="]),
        ("rtcfctl load rtcf_examples Wave --param amp", ["amplitude:="]),
        ("rtcfctl break sum.in", ["sum.in1", "sum.in2", "sum.in3", "sum.in4"]),
    ],
)
def test_existing_names_are_offered(service: Service, line: str, offered: list[str]) -> None:
    service.ctl("load", "rtcf_examples", "Wave", "--name", "wave")
    service.ctl("load", "rtcf_examples", "Mimo", "--name", "sum")
    # Completion gives up on slow answers; the user presses the key again.
    wait_for(lambda: completed(service, line) == offered, f"the completions {offered}")


def test_completion_does_not_start_a_stopped_service(service: Service) -> None:
    service.ctl("load", "rtcf_examples", "Wave", "--name", "wave")
    service.systemctl("stop", "rtcfd.service")
    assert service.unit_property("ActiveState", "rtcfd.socket") == "active"
    for line in ("rtcfctl info wa", "rtcfctl set wave amp", "rtcfctl -r rt_"):
        assert completed(service, line) == []
    assert service.unit_property("ActiveState") == "inactive"

"""Completion as it is installed: it offers what is there, and wakes nobody up."""

import shlex

import pytest
from machine import wait_for
from rtcf_service import Service


def completed(service: Service, line: str) -> list[str]:
    """Return what bash offers for the last word of a line."""
    words = line.split(" ")
    script = (
        "source /usr/share/bash-completion/completions/rtcfctl; "
        f"COMP_WORDS=({' '.join(map(shlex.quote, words))}); COMP_CWORD={len(words) - 1}; "
        # It is no prompt: there are no options of a completion.
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
def test_what_is_there_is_offered(service: Service, line: str, offered: list[str]) -> None:
    service.ctl("load", "rtcf_examples", "Wave", "--name", "wave")
    service.ctl("load", "rtcf_examples", "Mimo", "--name", "sum")
    # What takes too long is not waited for: one presses the key again.
    wait_for(lambda: completed(service, line) == offered, f"{offered} to be offered")


def test_a_service_that_was_stopped_stays_stopped(service: Service) -> None:
    service.ctl("load", "rtcf_examples", "Wave", "--name", "wave")
    service.systemctl("stop", "rtcfd.service")
    assert service.unit_property("ActiveState", "rtcfd.socket") == "active"
    for line in ("rtcfctl info wa", "rtcfctl set wave amp", "rtcfctl -r rt_"):
        assert completed(service, line) == []
    assert service.unit_property("ActiveState") == "inactive"

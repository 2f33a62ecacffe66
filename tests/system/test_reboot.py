"""Loops across a reboot of the machine."""

import pytest
from machine import wait_for
from rtcf_service import Service


@pytest.fixture
def resuming(service: Service) -> Service:
    """The service with a running loop that resumes at boot."""
    service.load_and_start()
    service.ctl("runner", "set", "--on-boot", "resume")
    return service


def test_a_loop_that_ran_until_the_reboot_runs_again(resuming: Service) -> None:
    before = resuming.status()["pid"]
    resuming.machine.reboot()
    resuming.wait_until_said("stopping all loops")
    resuming.wait_until_said("loop resumed")
    after = resuming.status()
    assert (after["state"], after["components"]) == ("running", 1)
    assert after["pid"] != before
    wait_for(lambda: resuming.iteration() > 10, "cycles")


@pytest.mark.parametrize("stop", ["systemctl stop rtcfd", "rtcfctl stop"])
def test_a_loop_that_was_stopped_before_the_reboot_stays_stopped(
    resuming: Service, stop: str
) -> None:
    resuming.machine.shell(stop)
    resuming.machine.reboot()
    after = resuming.status()
    assert (after["state"], after["components"]) == ("stopped", 1)
    assert not resuming.said("loop resumed")

"""Upgrade and reinstallation: loops run on until an administrator restarts rtcfd."""

from typing import Any

import pytest
import versions
from machine import Machine, wait_for
from rtcf_service import Service


@pytest.fixture(scope="module")
def revision(machine: Machine) -> str:
    return versions.make_revision(machine, "/debs", "/revision")


@pytest.fixture(scope="module")
def higher(machine: Machine) -> str:
    return versions.make_higher(machine, "/debs", "/upgrade")


def runs_on(service: Service, before: dict[str, Any], daemon: int) -> None:
    after = service.status()
    assert service.pid == daemon
    assert (after["pid"], after["realtime_tid"]) == (before["pid"], before["realtime_tid"])
    assert after["state"] == "running"
    wait_for(lambda: service.iteration() > int(after["iteration"]), "cycles")


def test_a_reinstallation_leaves_the_loop_alone(service: Service) -> None:
    before, daemon = service.load_and_start(), service.pid
    service.machine.shell("apt-get install --yes --quiet --reinstall /debs/rtcfd_*.deb")
    runs_on(service, before, daemon)


def test_changes_continue_while_packages_are_reinstalled(service: Service) -> None:
    before, daemon = service.load_and_start(), service.pid
    # One change after the other, by a client that was started before.
    script = (
        "import pathlib, rtcf\n"
        "done = 0\n"
        "with rtcf.Client() as client:\n"
        "    while not pathlib.Path('/var/tmp/enough').exists():\n"
        "        client.load(rtcf.component('rtcf_examples', 'Identity', name='again'))\n"
        "        client.unload(['again'])\n"
        "        done += 1\n"
        "print(done)\n"
    )
    changes = service.machine.start("python3", "-c", script)
    try:
        service.machine.shell("apt-get install --yes --quiet --reinstall /debs/*.deb")
    finally:
        service.machine.shell("touch /var/tmp/enough")
        said, errors = changes.communicate(timeout=60)
        service.machine.shell("rm /var/tmp/enough")
    assert changes.returncode == 0, errors
    assert int(said) > 0
    assert not [each for each in service.ctl("list").stdout.split() if "again" in each]
    runs_on(service, before, daemon)


def test_metrics_and_scope_restart_after_a_reinstallation(service: Service) -> None:
    units = ("rtcf-scope.service", "rtcf-metrics.service")

    def processes() -> list[int]:
        return [int(service.unit_property("MainPID", unit)) for unit in units]

    packages = "/debs/rtcf-scope_*.deb /debs/rtcfctl_*.deb"
    reinstall = f"apt-get install --yes --quiet --reinstall {packages}"
    service.machine.shell(reinstall)
    assert processes() == [0, 0], "services that were not started stay off"
    service.systemctl("start", *units)
    try:
        before = processes()
        service.machine.shell(reinstall)
        after = processes()
        assert all(after)
        assert not set(before) & set(after), "the old processes have ended"
    finally:
        service.systemctl("stop", *units)


@pytest.mark.parametrize("distance", [-2, 2])
def test_an_rtcfd_of_a_foreign_protocol_keeps_the_loop_and_reports_it(
    service: Service, distance: int
) -> None:
    machine, ours = service.machine, versions.protocol(service.machine)
    before = service.load_and_start()
    try:
        versions.speak(machine, ours + distance)
        service.systemctl("restart", "rtcfd.service")
        said = service.ctl("status").stdout
        assert f"which rtcfd {version(service)} with protocol {ours + distance} does not" in said
        assert "its loop goes on as it is; `rtcfctl -r rt_runner stop` ends it" in said
        done = service.ctl("load", "rtcf_examples", "Identity", check=False)
        assert (done.returncode, len(done.stderr.splitlines())) == (1, 1)
        machine.run("kill", "-0", str(before["realtime_tid"]))
    finally:
        versions.speak(machine, ours)
    service.systemctl("restart", "rtcfd.service")
    runs_on(service, before, service.pid)


def version(service: Service) -> str:
    return service.ctl("--version").stdout.split()[1]


def test_another_build_of_the_same_version_awaits_a_restart_of_the_loop(
    service: Service, revision: str
) -> None:
    before, daemon, installed = service.load_and_start(), service.pid, version(service)
    service.machine.shell(f"apt-get install --yes --quiet {revision}")
    runs_on(service, before, daemon)
    assert version(service) == installed
    assert "restart pending: rtcfd was upgraded" in service.ctl("status").stdout
    service.systemctl("restart", "rtcfd.service")
    assert service.pid != daemon
    runs_on(service, before, service.pid)
    said = service.ctl("status").stdout
    assert "rtcfd was upgraded" not in said
    assert f"restart pending: its executor is of another build of rtcf {installed}" in said
    service.ctl("runner", "restart", "rt_runner")
    assert "restart pending" not in service.ctl("status").stdout


def test_an_upgrade_leaves_the_loop_alone_until_the_restart(service: Service, higher: str) -> None:
    service.ctl("runner", "set", "--frequency", "2000")
    before, daemon = service.load_and_start(), service.pid
    assert "restart pending" not in service.ctl("status").stdout
    service.machine.shell(f"apt-get install --yes --quiet {higher}")
    runs_on(service, before, daemon)
    assert "restart pending: rtcfd was upgraded" in service.ctl("status").stdout
    # New client, old executor.
    service.ctl("load", "rtcf_examples", "Identity", "--name", "new")

    # An rtcfd with the next protocol works with the running executor.
    service.systemctl("restart", "rtcfd.service")
    assert service.pid != daemon
    runs_on(service, before, service.pid)
    said = service.ctl("status").stdout
    assert "rtcfd was upgraded" not in said
    assert "restart pending: its executor is of rtcf" in said
    service.ctl("unload", "new")
    service.ctl("load", "rtcf_examples", "Identity", "--name", "newer")
    runs_on(service, before, service.pid)

    service.ctl("runner", "restart", "rt_runner")
    after = service.status()
    assert after["pid"] != before["pid"]
    assert (after["state"], after["components"]) == ("stopped", 2)

"""Removal and purge. The last file, since the packages are gone afterwards."""

from machine import Machine, wait_for
from rtcf_service import Service

PACKAGES = ("librtcf-dev", "python3-rtcf", "ros-rtcf", "rtcf-arm", "rtcf-check", "rtcf-components",
            "rtcf-control", "rtcf-doc", "rtcf-mujoco", "rtcf-python", "rtcf-scope",
            "rtcfctl", "rtcfd")  # fmt: skip


def test_removal_while_rtcfd_is_dead_ends_its_loops(machine: Machine) -> None:
    drop_in = machine.path("/etc/systemd/system/rtcfd.service.d/slow.conf")
    drop_in.parent.mkdir(parents=True, exist_ok=True)
    # Prolong the moment between the death of rtcfd and its restart.
    drop_in.write_text("[Service]\nRestartSec=infinity\n")
    service = Service(machine)
    try:
        service.systemctl("daemon-reload")
        service.reset()
        service.load_and_start()
        service.kill("KILL", service.pid)
        wait_for(lambda: service.unit_property("SubState") == "auto-restart", "rtcfd to be dead")
        assert machine.run("pgrep", "-u", "rtcf").stdout
        machine.run("apt-get", "remove", "--yes", "--quiet", *PACKAGES)
        assert machine.run("pgrep", "-u", "rtcf", check=False).stdout == ""
    finally:
        drop_in.unlink()
        service.systemctl("daemon-reload")
        machine.shell("apt-get install --yes --quiet /debs/*.deb")


def test_an_installation_after_a_removal_starts_no_loop(machine: Machine) -> None:
    service = Service(machine)
    service.reset()
    service.load_and_start()
    service.ctl("runner", "set", "--on-boot", "resume")
    machine.run("apt-get", "remove", "--yes", "--quiet", *PACKAGES)
    machine.shell("apt-get install --yes --quiet /debs/*.deb")
    # Its graph is restored; its loop was stopped before.
    assert service.ctl("order").stdout.split() == ["/M"]
    assert service.status()["state"] == "stopped"
    assert not service.said("loop resumed")


def test_removal_ends_everything_and_keeps_settings_and_state(machine: Machine) -> None:
    # Not the fixture: after this test there is no service to restore.
    service = Service(machine)
    service.reset()
    service.ctl("load", "rtcf_examples", "Mimo", "--name", "M")
    others = ("rtcf-scope.service", "rtcf-metrics.service")
    service.systemctl("start", *others)
    machine.run("apt-get", "remove", "--yes", "--quiet", *PACKAGES)
    assert machine.run("pgrep", "-u", "rtcf", check=False).stdout == ""
    states = service.systemctl("is-active", *others, check=False).stdout.split()
    assert states == ["inactive", "inactive"]
    assert machine.run("ls", "/run/rtcfd", check=False).returncode != 0
    assert machine.path("/etc/rtcfd/rtcfd.toml").is_file()
    assert machine.path("/var/lib/rtcfd/rt_runner.json").is_file()
    assert machine.run("systemctl", "is-failed", "rtcfd.service", check=False).returncode != 0


def test_purge_leaves_nothing(machine: Machine) -> None:
    machine.shell("apt-get install --yes --quiet /debs/*.deb")
    machine.run("apt-get", "purge", "--yes", "--quiet", *PACKAGES)
    left = machine.shell(
        "find /usr /etc /var/lib /run -xdev -name '*rtcf*' -not -path '*/dpkg/*' "
        "-not -path '/var/lib/systemd/*' -not -path '/usr/share/doc/*'"
    )
    assert left.stdout == ""

"""Loops outlive rtcfd, and the service survives failures around it."""

import json

from machine import wait_for
from rtcf_service import Service

_DROP_IN = "/etc/systemd/system/rtcfd.service.d"


def restarted(service: Service, before: int) -> bool:
    return service.pid not in (0, before) and service.unit_property("ActiveState") == "active"


def test_a_killed_rtcfd_restarts_and_finds_its_loop_running(service: Service) -> None:
    before = service.load_and_start()
    killed = service.pid
    service.kill("KILL", killed)
    # The client waits for the next rtcfd.
    assert service.status()["pid"] == before["pid"]
    wait_for(lambda: restarted(service, killed), "another rtcfd")
    after = service.status()
    assert (after["pid"], after["state"]) == (before["pid"], "running")
    assert int(after["iteration"]) > int(before["iteration"])
    service.wait_until_said("adopted: loop running")


def test_the_watchdog_replaces_an_rtcfd_that_hangs(service: Service) -> None:
    service.machine.path(_DROP_IN).mkdir(parents=True, exist_ok=True)
    drop_in = service.machine.path(f"{_DROP_IN}/watchdog.conf")
    drop_in.write_text("[Service]\nWatchdogSec=10\n")
    try:
        service.systemctl("daemon-reload")
        service.systemctl("restart", "rtcfd.service")
        before = service.load_and_start()
        hung = service.pid
        service.kill("STOP", hung)
        wait_for(lambda: restarted(service, hung), "another rtcfd")
        after = service.status()
        assert (after["pid"], after["state"]) == (before["pid"], "running")
        assert int(after["iteration"]) > int(before["iteration"])
    finally:
        drop_in.unlink()
        service.systemctl("daemon-reload")


def test_a_stalled_journal_blocks_nothing(service: Service) -> None:
    before = service.load_and_start()
    journald = int(service.unit_property("MainPID", "systemd-journald.service"))
    # More records than the buffer of a datagram socket.
    script = (
        "import rtcf\n"
        "with rtcf.Client() as client:\n"
        "    for number in range(400):\n"
        "        client.load(rtcf.component('rtcf_examples', 'Identity', name='late'))\n"
        "        client.unload(['late'])\n"
    )
    service.kill("STOP", journald)
    try:
        service.machine.run("python3", "-c", script)
        after = service.status()
    finally:
        service.kill("CONT", journald)
    assert (after["pid"], after["state"]) == (before["pid"], "running")
    wait_for(
        lambda: sum("/late unloaded" in str(e.get("MESSAGE")) for e in service.journal()) == 400,
        "the records that waited",
    )


def test_a_killed_executor_restarts_with_its_graph(service: Service) -> None:
    before = service.load_and_start()
    service.kill("KILL", before["pid"])
    wait_for(lambda: service.status().get("pid", 0) not in (0, before["pid"]), "another executor")
    wait_for(lambda: service.status().get("components") == 1, "its graph")
    wait_for(lambda: "was killed by SIGKILL" in service.status().get("status", ""), "the reason")
    service.ctl("start")
    wait_for(lambda: service.iteration() > 10, "cycles")


def test_reexecuting_systemd_changes_nothing(service: Service) -> None:
    before, daemon = service.load_and_start(), service.pid
    service.systemctl("daemon-reexec")
    after = service.status()
    assert service.pid == daemon
    assert (after["pid"], after["state"]) == (before["pid"], "running")
    assert int(after["iteration"]) > int(before["iteration"])


def test_a_full_disk_is_reported_and_survived(service: Service) -> None:
    machine = service.machine
    service.systemctl("stop", "rtcfd.service")
    machine.run("mount", "-t", "tmpfs", "-o", "size=64k,mode=750,uid=rtcf,gid=rtcf", "tmpfs",
                "/var/lib/rtcfd")  # fmt: skip
    try:
        service.systemctl("start", "rtcfd.service")
        machine.shell("dd if=/dev/zero of=/var/lib/rtcfd/full bs=4k 2>/dev/null; true")
        done = service.ctl("load", "rtcf_examples", "Mimo", "--name", "M")
        assert "not saved: No space left on device" in done.stderr
        service.ctl("start")
        assert "not saved" in service.status()["status"]
        machine.run("rm", "/var/lib/rtcfd/full")
        service.ctl("stop")
        assert "not saved" not in service.status().get("status", "")
    finally:
        service.systemctl("stop", "rtcfd.service")
        machine.run("umount", "/var/lib/rtcfd")


def test_a_stop_is_final_on_a_read_only_disk(service: Service) -> None:
    machine = service.machine

    def anew() -> str:
        service.systemctl("reset-failed", "rtcfd.service")  # many starts in a short time
        service.stop_and_start()
        return str(service.status()["state"])

    service.configure('[runner]\non_boot = "resume"\n')
    service.systemctl("stop", "rtcfd.service")
    machine.run("mount", "-t", "tmpfs", "-o", "mode=750,uid=rtcf,gid=rtcf", "tmpfs",
                "/var/lib/rtcfd")  # fmt: skip
    try:
        service.systemctl("start", "rtcfd.service")
        service.load_and_start()
        machine.run("mount", "-o", "remount,ro", "/var/lib/rtcfd")
        # Running loops survive a restart.
        service.systemctl("restart", "rtcfd.service")
        assert service.status()["state"] == "running"
        assert "is not resumed" not in service.ctl("status").stdout
        assert "not saved: Read-only file system" in service.ctl("stop").stderr
        # The executor, which remembered the stop, ends with the service.
        assert anew() == "stopped"
        machine.run("mount", "-o", "remount,rw", "/var/lib/rtcfd")
        assert anew() == "stopped"
        service.ctl("start")
        machine.run("mount", "-o", "remount,ro", "/var/lib/rtcfd")
        assert anew() == "stopped"
    finally:
        service.systemctl("stop", "rtcfd.service")
        machine.run("umount", "/var/lib/rtcfd")


def test_a_read_only_etc_is_enough(service: Service) -> None:
    machine = service.machine
    machine.run("mount", "--bind", "/etc", "/etc")
    machine.run("mount", "-o", "remount,bind,ro", "/etc")
    try:
        service.stop_and_start()
        assert service.load_and_start()["state"] == "running"
        service.systemctl("reload", "rtcfd.service")
    finally:
        service.systemctl("stop", "rtcfd.service")
        machine.run("umount", "/etc")


def test_a_corrupt_state_is_set_aside_and_reported(service: Service) -> None:
    service.load_and_start()
    service.systemctl("stop", "rtcfd.service")
    service.machine.shell("echo '{ \"version\": 1, ' > /var/lib/rtcfd/rt_runner.json")
    service.systemctl("start", "rtcfd.service")
    assert service.status().get("components", 0) == 0
    assert "rt_runner.corrupt-" in service.machine.run("ls", "/var/lib/rtcfd").stdout
    service.wait_until_said("is corrupt")
    assert "set aside as rt_runner.corrupt-" in service.ctl("status").stdout


def test_two_hundred_clients_at_once_are_served(service: Service) -> None:
    script = (
        "import sys, threading, rtcf\n"
        "clients = [rtcf.Client() for _ in range(200)]\n"
        "answers = []\n"
        "go = threading.Barrier(200)\n"
        "def ask(client):\n"
        "    go.wait()\n"
        "    answers.append(client.get_status().version)\n"
        "threads = [threading.Thread(target=ask, args=(c,)) for c in clients]\n"
        "[t.start() for t in threads]; [t.join() for t in threads]\n"
        "print(len(answers), len(set(answers)))\n"
    )
    before = service.load_and_start()
    assert service.machine.run("python3", "-c", script).stdout.split() == ["200", "1"]
    after = service.status()
    assert (after["pid"], after["state"]) == (before["pid"], "running")


def test_the_state_survives_a_stop_and_a_start(service: Service) -> None:
    service.load_and_start()
    service.ctl("runner", "set", "--frequency", "500")
    service.stop_and_start()
    status = service.status()
    assert (status["state"], status["components"]) == ("stopped", 1)
    assert status["settings"]["frequency_hz"] == 500
    assert json.loads(service.ctl("-o", "json", "order").stdout) == ["/M"]

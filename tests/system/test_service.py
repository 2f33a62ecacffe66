"""The service under systemd: start, activation, journal, reload, stop."""

import json

from machine import wait_for
from rtcf_service import SETTINGS, Service

GRAPH = """\
runner: rt_runner
components:
  - {name: A, package: rtcf_examples, type: Mimo}
  - {name: B, package: rtcf_examples, type: Mimo, remaps: {in1: /out1, out1: /b1, out2: /b2}}
"""


def test_a_component_is_loaded_and_runs(service: Service) -> None:
    status = service.load_and_start()
    assert status["state"] == "running"
    assert "M" in service.ctl("order").stdout


def test_the_journal_records_actions_and_users(service: Service) -> None:
    service.ctl("load", "rtcf_examples", "Mimo", "--name", "M", user="alice")
    service.ctl("start", user="alice")
    wait_for(lambda: service.said("loop started"), "the start in the journal")
    loaded = service.journal("RTCF_USER=alice")[0]
    assert loaded["MESSAGE"].startswith("Load by alice (uid ")
    assert loaded["RTCF_UID"] == service.machine.run("id", "-u", "alice").stdout.strip()
    assert int(loaded["RTCF_PID"]) > 1
    about = [entry["MESSAGE"] for entry in service.journal("RTCF_RUNNER=rt_runner")]
    assert "rt_runner: /M loaded (rtcf_examples/Mimo)" in about
    assert "rt_runner: loop started" in about
    assert all(entry["SYSLOG_IDENTIFIER"] == "rtcfd" for entry in service.journal()
               if "RTCF_RUNNER" in entry)  # fmt: skip


def test_the_first_client_starts_the_service_and_waits_for_it(service: Service) -> None:
    service.systemctl("stop", "rtcfd.service")
    assert service.unit_property("ActiveState") == "inactive"
    assert "rt_runner" in service.ctl("status").stdout
    # The client may get its answer before systemd has processed the notification.
    wait_for(lambda: service.unit_property("ActiveState") == "active", "systemd to be notified")


def test_a_client_waits_during_a_restart(service: Service) -> None:
    restart = service.machine.start("systemctl", "restart", "rtcfd.service")
    while restart.poll() is None:
        service.ctl("status")
    service.ctl("status")


def test_a_reload_changes_settings_and_leaves_the_loop_alone(service: Service) -> None:
    service.ctl("runner", "set", "--frequency", "50")
    before = service.load_and_start()

    # Other load of this machine may cost a cycle; a reload that always costs one fails.
    for attempt in range(10):
        missed = service.status().get("missed", 0)
        service.configure(f"[limits]\nclients = {100 + attempt}\n")
        service.systemctl("reload", "rtcfd.service")
        after = service.status()
        if after.get("missed", 0) == missed:
            break
    assert after.get("missed", 0) == missed
    assert (after["pid"], after["realtime_tid"]) == (before["pid"], before["realtime_tid"])
    assert after["state"] == "running"
    assert int(after["iteration"]) > int(before["iteration"])
    service.wait_until_said("limits changed")


def test_a_reload_of_bad_settings_is_rejected_with_the_line(service: Service) -> None:
    before = service.load_and_start()
    service.machine.path(SETTINGS).write_text('[daemon]\nrealtime = "preferred"\nsokcet = "/x"\n')
    assert service.systemctl("reload", "rtcfd.service", check=False).returncode != 0
    service.wait_until_said(f'{SETTINGS}:3: unknown key "daemon.sokcet"; did you mean "socket"?')
    error = f'{SETTINGS}:3: unknown key "daemon.sokcet"'
    assert f"settings not reloaded: {error}" in service.ctl("status").stdout
    # Another error replaces it.
    service.machine.path(SETTINGS).write_text("[runner]\nfrequency_hz = -1\n")
    assert service.systemctl("reload", "rtcfd.service", check=False).returncode != 0
    notes = service.ctl("status").stdout
    assert f"settings not reloaded: {SETTINGS}:2: frequency of -1 Hz is out of range" in notes
    assert "sokcet" not in notes
    assert service.status()["pid"] == before["pid"]
    assert service.status()["state"] == "running"


def test_the_check_finds_what_the_service_cannot_read_or_write(service: Service) -> None:
    machine = service.machine
    assert machine.run("rtcfd", "--check-config").stdout == "settings and graphs are valid\n"
    machine.path(SETTINGS).write_text('[daemon]\nstate_dir = "/var/lib/rtcf2"\n')
    graph = machine.path("/etc/rtcfd/graphs.d/a.yaml")
    graph.write_text("components: []\n")
    graph.chmod(0o600)
    done = machine.run("rtcfd", "--check-config", check=False)
    assert done.returncode == 1
    assert "cannot read /etc/rtcfd/graphs.d/a.yaml: Permission denied" in done.stderr
    assert "daemon.state_dir: /var/lib/rtcf2 is read-only in the sandbox" in done.stderr
    assert "`systemctl edit rtcfd` with StateDirectory=rtcfd rtcf2 under" in done.stderr
    # The service finds the same, and keeps its settings.
    before = service.pid
    assert service.systemctl("reload", "rtcfd.service", check=False).returncode != 0
    assert "daemon.state_dir: /var/lib is read-only" in service.ctl("status").stdout
    service.systemctl("restart", "rtcfd.service")
    assert service.pid != before
    assert "the last good settings are used instead" in service.ctl("status").stdout
    graph.unlink()
    service.configure("")


def test_a_service_with_bad_settings_uses_the_last_good_ones(service: Service) -> None:
    executor = service.load_and_start()["pid"]
    service.configure("[runner]\nfrequency_hz = 0\n")
    assert service.machine.run("rtcfd", "--check-config", check=False).returncode == 1
    service.systemctl("restart", "rtcfd.service")
    service.wait_until_said("frequency of 0 Hz is out of range")
    assert "the last good settings are used instead" in service.ctl("status").stdout
    assert (service.status()["pid"], service.status()["state"]) == (executor, "running")
    service.configure("")
    service.systemctl("reload", "rtcfd.service")
    assert "last good" not in service.ctl("status").stdout


def test_graphs_d_is_loaded_at_boot(service: Service) -> None:
    service.machine.path("/etc/rtcfd/graphs.d/line.yaml").write_text(GRAPH)
    service.stop_and_start()
    assert service.ctl("-o", "json", "order").stdout.count("/") == 2
    service.wait_until_said("runner rt_runner set up from /etc/rtcfd/graphs.d/line.yaml")


def test_a_reload_applies_changed_graphs(service: Service) -> None:
    before = service.load_and_start()
    service.machine.path("/etc/rtcfd/graphs.d/line.yaml").write_text(GRAPH)
    service.systemctl("reload", "rtcfd.service")
    assert [name.strip("/") for name in json.loads(service.ctl("-o", "json", "order").stdout)] == [
        "A",
        "B",
    ]
    after = service.status()
    assert (after["pid"], after["state"]) == (before["pid"], "running")


def test_a_bad_graph_is_reported_and_the_others_are_applied(service: Service) -> None:
    folder = service.machine.path("/etc/rtcfd/graphs.d")
    (folder / "a-bad.yaml").write_text("runner: other\ncomponentz: []\n")
    (folder / "line.yaml").write_text(GRAPH)
    service.stop_and_start()
    assert "a-bad.yaml:2" in service.ctl("status").stdout
    assert service.status()["components"] == 2


def test_a_restart_leaves_the_loop_alone_and_reads_settings_and_graphs(service: Service) -> None:
    before, daemon = service.load_and_start(), service.pid
    service.configure("[runner]\nfrequency_hz = 500\n")
    service.machine.path("/etc/rtcfd/graphs.d/line.yaml").write_text(GRAPH)
    service.systemctl("restart", "rtcfd.service")
    after = service.status()
    assert service.pid not in (0, daemon)
    assert service.unit_property("NRestarts") == "0"
    assert (after["pid"], after["realtime_tid"]) == (before["pid"], before["realtime_tid"])
    assert (after["state"], after["components"]) == ("running", 2)
    assert after["settings"]["frequency_hz"] == 500
    assert int(after["iteration"]) > int(before["iteration"])
    said = [entry["MESSAGE"] for entry in service.journal()]
    assert "leaving all loops to the next rtcfd" in said
    assert "stopping all loops" not in said


def test_a_stop_ends_loops_in_order_and_leaves_nothing(service: Service) -> None:
    executor = service.load_and_start()["pid"]
    service.systemctl("stop", "rtcfd.service")
    assert service.unit_property("Result") == "success"
    assert service.machine.run("kill", "-0", str(executor), check=False).returncode != 0
    order = [entry["MESSAGE"] for entry in service.journal()]
    said = ("stopping all loops", "ended")
    places = [next(i for i, text in enumerate(order) if text == each) for each in said]
    assert places == sorted(places)
    assert not service.machine.shell("ls -A /run/rtcfd/executors 2>/dev/null; true").stdout


def test_a_stop_of_the_socket_stops_everything(service: Service) -> None:
    service.systemctl("stop", "rtcfd.socket")
    wait_for(lambda: service.unit_property("ActiveState") == "inactive", "the stop of rtcfd")
    done = service.ctl("status", check=False)
    assert done.returncode == 3
    assert "systemctl start rtcfd" in done.stderr

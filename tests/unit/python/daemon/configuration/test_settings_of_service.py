"""Settings and graphs of the service: checked, reloaded, and replaced by the last good ones."""

import asyncio
import logging
import os
import signal
import subprocess
import threading
from collections.abc import Callable
from pathlib import Path

import odd_files
import pytest
import rtcf
from daemon_process import BUILD_TREE
from daemon_under_test import DaemonUnderTest
from rtcfd.check_config import unit_of
from rtcfd.common.errors import RequestError
from rtcfd.configuration import options
from rtcfd.configuration.last_good import Settings
from rtcfd.journal import standing_alone
from rtcfd.main import Daemon
from rtcfd.state import store

GOOD = "[runner]\nfrequency_hz = 250.0\n"
BAD = '[runner]\nfrequency_hz = "fast"\n'
GRAPH = "components:\n  - {package: demo, type: Fine, name: a}\n"
REFUSED = "runner: arm\ncomponents:\n  - {package: demo, type: Nothing}\n"


def rtcfd(daemon: DaemonUnderTest, *arguments: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [str(BUILD_TREE / "bin" / "rtcfd"), "--socket", str(daemon.socket), *arguments],
        capture_output=True, text=True, check=False,
    )  # fmt: skip


def test_a_start_with_bad_settings_uses_the_last_good_ones_with_a_note(
    stopped_daemon: DaemonUnderTest,
) -> None:
    daemon = stopped_daemon
    daemon.settings.write_text(GOOD)
    daemon.start_service()
    daemon.end()
    daemon.settings.write_text(BAD)
    daemon.start_service()
    with daemon.client() as client:
        status = client.get_status()
    assert status.runners[0].settings.frequency_hz == 250.0
    said = f"{daemon.settings}:2: runner.frequency_hz must be a number"
    assert status.notes[0].startswith(said)
    assert status.notes[0].endswith("; the last good settings are used instead")
    assert said in daemon.log()
    # Corrected settings are read without a restart.
    daemon.settings.write_text(GOOD.replace("250", "500"))
    assert rtcfd(daemon, "--reload").returncode == 0
    with daemon.client() as client:
        status = client.get_status()
    assert (status.runners[0].settings.frequency_hz, list(status.notes)) == (500.0, [])


def test_a_restart_warns_of_settings_that_the_next_rtcfd_will_reject(
    stopped_daemon: DaemonUnderTest,
) -> None:
    daemon = stopped_daemon
    daemon.settings.write_text(GOOD)
    daemon.start_service()
    daemon.settings.write_text(GOOD + "priority = 70\n")
    assert daemon.end(signal.SIGUSR1) == 0
    assert "last good settings" not in daemon.log()
    daemon.start_service()
    daemon.settings.write_text(BAD)
    assert daemon.end(signal.SIGUSR1) == 0
    said = f"{daemon.settings}:2: runner.frequency_hz must be a number"
    assert f"the next rtcfd will use the last good settings: {said}" in daemon.log()
    # And so it does.
    daemon.start_service()
    with daemon.client() as client:
        settings = client.get_status().runners[0].settings
    assert (settings.frequency_hz, settings.priority) == (250.0, 70)


def test_unreadable_settings_block_no_restart(
    stopped_daemon: DaemonUnderTest,
    caplog: pytest.LogCaptureFixture,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    daemon = stopped_daemon
    # The lock would last as long as this test process.
    monkeypatch.setattr(store, "_lock", lambda _: None)
    daemon.settings.touch()
    daemon.graphs.mkdir()
    given = options.parse(
        [
            *("--socket", str(daemon.socket), "--state-dir", str(daemon.state)),
            *("--path", str(daemon.packages), "--executor", str(daemon.executor)),
            *("--runtime-dir", str(daemon.folder / "run"), "--config", str(daemon.settings)),
            *("--graphs-dir", str(daemon.graphs)),
        ],
        BUILD_TREE,
    )
    hangs, asked = threading.Event(), threading.Event()

    def read_options() -> options.Options:
        """Read a file on a server that does not answer."""
        asked.set()
        hangs.wait()
        return given

    async def run() -> int:
        running = asyncio.create_task(Daemon(given, read_options).run())

        def executor() -> int:
            with daemon.client() as client:
                pid: int = client.get_status().runners[0].pid
            return pid

        while "ready; runners" not in caplog.text:
            await asyncio.sleep(0.01)
        pid = await asyncio.to_thread(executor)
        os.kill(os.getpid(), signal.SIGUSR1)
        await running
        return pid

    caplog.set_level(logging.INFO)
    try:
        with odd_files.deadline():
            pid = asyncio.run(run())
    finally:
        hangs.set()
    assert asked.is_set()
    assert "cannot check the settings for the next rtcfd" in caplog.text
    # The executor was handed over to the next rtcfd.
    daemon.start_service()
    assert daemon.executor_pid() == pid


def test_the_last_good_settings_are_synced_before_the_rename(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    settings = tmp_path / "rtcfd.toml"
    settings.write_text(GOOD)
    state = tmp_path / "state"
    state.mkdir()
    copy = state / "rtcfd.toml.last-good"
    synced: list[tuple[str, bool]] = []  # kind, and whether the copy has its name by then

    def fsync(descriptor: int) -> None:
        file = Path(os.readlink(f"/proc/self/fd/{descriptor}"))
        synced.append((str(file.relative_to(tmp_path)), copy.exists()))

    monkeypatch.setattr(os, "fsync", fsync)
    Settings.read(settings, state, last_good=True).keep()
    assert synced == [("state/.rtcfd.toml.last-good.new", False), ("state", True)]
    assert [file.name for file in state.iterdir()] == [copy.name]


def test_an_empty_copy_grants_no_rights(tmp_path: Path) -> None:
    settings = tmp_path / "rtcfd.toml"
    copy = tmp_path / "rtcfd.toml.last-good"
    settings.write_text(BAD)
    copy.touch()
    with pytest.raises(RequestError, match="frequency_hz must be a number"):
        Settings.read(settings, tmp_path, last_good=True)
    # A file without settings has a copy, too, which is not an empty file.
    settings.write_text("")
    Settings.read(settings, tmp_path, last_good=True).keep()
    settings.write_text(BAD)
    assert "frequency_hz" in Settings.read(settings, tmp_path, last_good=True).problem


@pytest.mark.parametrize("odd", [odd_files.pipe, odd_files.dangling, odd_files.plug])
def test_anything_at_the_copys_path_is_replaced(
    tmp_path: Path, odd: Callable[[Path], None]
) -> None:
    settings = tmp_path / "rtcfd.toml"
    settings.write_text(GOOD)
    odd(tmp_path / "rtcfd.toml.last-good")
    odd(tmp_path / ".rtcfd.toml.last-good.new")
    with odd_files.deadline():
        Settings.read(settings, tmp_path, last_good=True).keep()
    assert (tmp_path / "rtcfd.toml.last-good").read_text() == GOOD
    assert not (tmp_path / "nowhere").exists()


def test_pipes_in_place_of_files_block_no_start(
    stopped_daemon: DaemonUnderTest,
) -> None:
    daemon = stopped_daemon
    executors = daemon.folder / "run" / "executors"
    for folder in (daemon.state, daemon.graphs, executors):
        folder.mkdir(parents=True)
    names = ("rt_runner.json", "rt_runner.history", "rt_runner.running", "rtcfd.toml.last-good")
    for name in names:
        odd_files.pipe(daemon.state / name)
        odd_files.pipe(daemon.state / f".{name}.new")
    for name in ("handover.json", ".handover.json.new", "rt_runner.libraries"):
        odd_files.pipe(executors / name)
    odd_files.pipe(daemon.graphs / "a.yaml")
    daemon.start_service()
    with daemon.client() as client:
        client.load(rtcf.component("demo", "Fine", name="a"))
        client.start()
        notes = " ".join(client.get_status().notes)
    assert "rt_runner.json is set aside as rt_runner.unreadable-" in notes
    assert f"cannot read {daemon.graphs}/a.yaml: it is a named pipe" in notes
    assert daemon.saved()["running"] is True
    # Nor do they block the handover to the next rtcfd.
    daemon.end(signal.SIGUSR1)
    daemon.start_service()
    with daemon.client() as client:
        assert client.get_order() == ["/a"]


def test_a_reload_fails_if_a_graph_is_rejected(stopped_daemon: DaemonUnderTest) -> None:
    daemon = stopped_daemon.start_service()
    (daemon.graphs / "a.yaml").write_text(GRAPH)
    done = rtcfd(daemon, "--reload")
    assert (done.returncode, done.stderr) == (0, "")
    refused = daemon.graphs / "b.yaml"
    refused.write_text(REFUSED)
    done = rtcfd(daemon, "--reload")
    assert done.returncode == 1
    assert done.stderr.startswith(f"rtcfd: not applied: {refused}: ")
    assert 'no type "Nothing"' in done.stderr
    assert str(refused) not in done.stdout
    # The journal's last line agrees.
    ends = [line for line in daemon.log().splitlines() if "Reload by" in line]
    assert [line.endswith(": done") for line in ends] == [True, False]
    assert f"partly failed: {refused}: " in ends[1]


def test_a_failed_reload_is_reported_until_one_succeeds(
    stopped_daemon: DaemonUnderTest,
) -> None:
    daemon = stopped_daemon
    daemon.settings.write_text(GOOD)
    daemon.start_service()
    daemon.settings.write_text(BAD)
    assert rtcfd(daemon, "--reload").returncode == 1
    said = f"settings not reloaded: {daemon.settings}:2: runner.frequency_hz must be a number"
    with daemon.client() as client:
        (note,) = client.get_status().notes
        assert note.startswith(said)
    assert f"rtcfd: {said}" in daemon.ctl("status").stdout
    doctor = daemon.ctl("doctor", "--seconds", "0").stdout
    assert said in " ".join(doctor.split())
    daemon.settings.write_text(GOOD)
    assert rtcfd(daemon, "--reload").returncode == 0
    with daemon.client() as client:
        assert not client.get_status().notes


@pytest.fixture
def reloading(
    stopped_daemon: DaemonUnderTest,
) -> tuple[DaemonUnderTest, Callable[[], subprocess.CompletedProcess[str]]]:
    """A service, and `systemctl reload`: it gets the same file, and no socket."""
    daemon = stopped_daemon
    daemon.settings.write_text(f'[daemon]\nsocket = "{daemon.socket}"\n' + GOOD)
    daemon.start_service()

    def reload() -> subprocess.CompletedProcess[str]:
        return subprocess.run(
            [
                *(str(BUILD_TREE / "bin" / "rtcfd"), "--reload"),
                *("--config", str(daemon.settings), "--state-dir", str(daemon.state)),
            ],
            env={name: value for name, value in os.environ.items() if name != "RTCF_SOCKET"},
            capture_output=True, text=True, check=False,
        )  # fmt: skip

    return daemon, reload


def text(content: str) -> Callable[[Path], None]:
    def write(place: Path) -> None:
        place.write_text(content)

    return write


@pytest.mark.parametrize(
    ("bad", "said"),
    [
        (text("[daemon]\nsocket = '{socket}'\n[runner]\nfrequency_hz = -1\n"),
         "frequency of -1 Hz is out of range"),
        (text("[nope]\n[daemon]\nsocket = '{socket}'\n"), 'unknown key "nope"'),
        # The socket is from the last good settings.
        (text("x = \n"), "Invalid value"),
        (odd_files.folder, "it is a folder"),
        (odd_files.dangling, "symbolic link that leads nowhere"),
        (odd_files.pipe, "it is a named pipe"),
    ],
    ids=["value", "key", "syntax", "folder", "link", "pipe"],
)  # fmt: skip
def test_each_rejected_reload_replaces_the_error_in_the_status(
    reloading: tuple[DaemonUnderTest, Callable[[], subprocess.CompletedProcess[str]]],
    bad: Callable[[Path], None],
    said: str,
) -> None:
    daemon, reload = reloading
    good = daemon.settings.read_text()
    daemon.settings.write_text(good + "[runner.ros]\nwhitelist = '*'\n")
    assert reload().returncode == 1
    with daemon.client() as client:
        (note,) = client.get_status().notes
        assert "whitelist: bad regular expression" in note
        daemon.settings.unlink()
        bad(daemon.settings)
        if daemon.settings.is_file():
            content = daemon.settings.read_text()
            daemon.settings.write_text(content.replace("{socket}", str(daemon.socket)))
        with odd_files.deadline():
            done = reload()
        assert (done.returncode, done.stdout) == (1, "")
        (note,) = client.get_status().notes
        assert done.stderr == f"rtcfd: not reloaded: {note.partition('not reloaded: ')[2]}\n"
    assert note.startswith("settings not reloaded: ")
    assert str(daemon.settings) in note and said in note
    assert f"rtcfd: {note}" in daemon.ctl("status").stdout
    doctor = " ".join(daemon.ctl("doctor", "--seconds", "0").stdout.split())
    assert note in doctor and "whitelist" not in doctor
    daemon.settings.rmdir() if daemon.settings.is_dir() else daemon.settings.unlink()
    daemon.settings.write_text(good)
    assert reload().returncode == 0
    with daemon.client() as client:
        assert not client.get_status().notes


def test_a_reload_without_a_daemon_names_the_error_in_the_file(
    reloading: tuple[DaemonUnderTest, Callable[[], subprocess.CompletedProcess[str]]],
) -> None:
    daemon, reload = reloading
    daemon.end()
    daemon.settings.write_text("x = \n")
    done = reload()
    assert (done.returncode, done.stdout) == (1, "")
    first, second = done.stderr.splitlines()
    assert first.startswith("rtcfd: not reloaded: ")
    assert second.startswith(f"rtcfd: {daemon.settings}: Invalid value")


def test_a_reload_by_an_rtcfd_with_another_file_names_the_error_in_ours(
    reloading: tuple[DaemonUnderTest, Callable[[], subprocess.CompletedProcess[str]]],
    tmp_path: Path,
) -> None:
    daemon, _ = reloading
    other = tmp_path / "other.toml"
    other.write_text(f'[daemon]\nsocket = "{daemon.socket}"\n' + BAD)
    done = subprocess.run(
        [str(BUILD_TREE / "bin" / "rtcfd"), "--reload", "--config", str(other)],
        capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert done.returncode == 1
    assert done.stderr.startswith(
        f"rtcfd: the rtcfd at {daemon.socket} has reloaded its own settings, but {other}:4: "
        "runner.frequency_hz must be a number"
    )
    assert done.stderr.count("\n") == 1


def test_a_reload_restores_folder_permissions_changed_by_systemd(
    stopped_daemon: DaemonUnderTest,
) -> None:
    daemon = stopped_daemon.start_service()
    folders = {name: daemon.folder / "run" / name for name in ("executors", "stop", "cpus")}
    modes = {name: folder.stat().st_mode & 0o777 for name, folder in folders.items()}
    assert modes == {"executors": 0o700, "stop": 0o750, "cpus": 0o700}
    for folder in folders.values():
        folder.chmod(0o750)  # systemd does so with each command, for RuntimeDirectoryMode=
    # Until then, other users cannot read the files inside, either.
    files = [each for each in folders["executors"].iterdir() if each.is_file()]
    assert "handover.json" in [each.name for each in files]
    assert {each.stat().st_mode & 0o777 for each in files} == {0o600}
    assert rtcfd(daemon, "--reload").returncode == 0
    assert {n: f.stat().st_mode & 0o777 for n, f in folders.items()} == modes


def check_of(daemon: DaemonUnderTest) -> tuple[str, ...]:
    """Return the arguments that check the settings and graphs of a daemon."""
    return (
        *("--check-config", "--config", str(daemon.settings)),
        *("--graphs-dir", str(daemon.graphs), "--executor", str(daemon.executor)),
        *("--path", str(daemon.packages)),
    )


@pytest.mark.parametrize(
    ("component", "said"),
    [
        ("package: gone, type: Fine", '/a: no package "gone" with component libraries in '),
        ("package: demo, type: Fien", '/a: no type "Fien" in package "demo"; did you mean "Fine"?'),
        ("package: demo, type: Fine, parameters: {kp: -1}", "/a: parameter kp = -1 is below its"),
        ("package: demo, type: Fine, parameters: {ki: 1}", "/a has no parameter ki"),
    ],
    ids=["package", "type", "range", "parameter"],
)
def test_the_components_of_graphs_are_checked(
    stopped_daemon: DaemonUnderTest, component: str, said: str
) -> None:
    daemon = stopped_daemon
    daemon.settings.touch()
    daemon.graphs.mkdir()
    graph = daemon.graphs / "a.yaml"
    graph.write_text(f"components:\n  - {{{component}, name: a}}\n")
    done = rtcfd(daemon, *check_of(daemon))
    assert (done.returncode, done.stdout) == (1, "")
    assert done.stderr.startswith(f"rtcfd: {graph}: {said}")
    assert done.stderr.count("\n") == 1


def test_unknown_users_of_access_rules_are_errors_of_the_check(
    stopped_daemon: DaemonUnderTest,
) -> None:
    daemon = stopped_daemon
    daemon.settings.write_text(
        '[access]\noperate = ["root", "alcie"]\ntune = ["@root", "@opreators"]\n'
        '[[access.parameters]]\nwho = ["bbo"]\n'
    )
    done = rtcfd(daemon, *check_of(daemon))
    assert done.returncode == 1
    assert done.stderr == (
        "rtcfd: [access] names the unknown group opreators: correct the name, or add it\n"
        "rtcfd: [access] names the unknown user alcie: correct the name, or add it\n"
        "rtcfd: [access] names the unknown user bbo: correct the name, or add it\n"
    )


def test_a_state_folder_that_cannot_be_written_is_neither_loaded_nor_kept(
    stopped_daemon: DaemonUnderTest,
) -> None:
    daemon = stopped_daemon
    daemon.settings.write_text(GOOD)
    daemon.start_service()
    daemon.settings.write_text(f'[daemon]\nstate_dir = "{daemon.settings}/state"\n')
    said = f"{daemon.settings}:2: daemon.state_dir: {daemon.settings} is not a folder"
    done = rtcfd(daemon, "--reload")
    assert (done.returncode, done.stdout) == (1, "")
    assert said in done.stderr
    daemon.end()
    daemon.start_service()
    with daemon.client() as client:
        status = client.get_status()
    assert status.runners[0].settings.frequency_hz == 250.0
    assert status.notes[0].startswith(said)


def test_a_start_names_the_values_that_its_graph_file_replaces(
    stopped_daemon: DaemonUnderTest,
) -> None:
    daemon = stopped_daemon
    daemon.graphs.mkdir()
    file = daemon.graphs / "a.yaml"
    file.write_text("components:\n  - {package: demo, type: Fine, name: a, parameters: {kp: 2}}\n")
    daemon.start_service()
    with daemon.client() as client:
        assert "replaced" not in client.get_status().runners[0].status
        client.set_parameters("a", [rtcf.parse_parameter("kp:=3.5")])
    daemon.end()
    daemon.start_service()
    said = (
        f"{file} replaced changes by hand: /a.kp 3.5 -> 2: to keep such changes, write them to the "
        "file: `rtcfctl -r rt_runner save FILE`"
    )
    with daemon.client() as client:
        assert said in client.get_status().runners[0].status
    assert f"runner rt_runner: {said}" in daemon.log()


SHOWN = """\
LoadState=loaded
User=rtcf
ProtectSystem=strict
StateDirectory=rtcfd
RuntimeDirectory=rtcfd/executors rtcfd/stop
ReadWritePaths=-/srv/state
"""


@pytest.mark.parametrize(
    ("folder", "said"),
    [
        ("/var/lib/rtcfd", ""),
        ("/run/rtcfd/executors", ""),
        ("/srv/state/rtcfd", ""),
        ("/var/lib/rtcf2", "with StateDirectory=rtcfd rtcf2 under [Service] permits it"),
        ("/opt/state", "with ReadWritePaths=/opt/state under [Service] permits it"),
    ],
)
def test_the_check_knows_the_folders_that_the_sandbox_lets_the_service_write(
    folder: str, said: str
) -> None:
    unit = unit_of(SHOWN)
    assert unit is not None
    assert unit.user == "rtcf"
    error = unit.error("state_dir", Path(folder))
    assert error.endswith(said) if said else not error
    assert unit_of("LoadState=not-found\n") is None


def test_settings_and_graphs_are_checked_without_a_daemon(stopped_daemon: DaemonUnderTest) -> None:
    daemon = stopped_daemon
    daemon.graphs.mkdir()
    daemon.settings.write_text(GOOD)
    (daemon.graphs / "a.yaml").write_text(GRAPH)
    arguments = check_of(daemon)
    done = rtcfd(daemon, *arguments)
    assert (done.returncode, done.stdout) == (0, "settings and graphs are valid\n")
    (daemon.graphs / "a.yaml").write_text("components: 5\n")
    done = rtcfd(daemon, *arguments)
    assert (done.returncode, done.stdout) == (1, "")
    assert done.stderr == f"rtcfd: {daemon.graphs}/a.yaml:1: components must be a list\n"
    daemon.settings.write_text(BAD)
    done = rtcfd(daemon, *arguments)
    assert done.returncode == 1
    assert f"{daemon.settings}:2: runner.frequency_hz must be a number" in done.stderr


@pytest.mark.parametrize(
    ("line", "said"),
    [
        (
            "latch = '*.ros'",
            "latch: bad regular expression '*.ros': a repeat (*",
        ),
        ("whitelist = '['", "whitelist: bad regular expression '[': a [ is not closed"),
        ('latch = """a\nb("""', "latch: bad regular expression 'a b(': a ( is not closed"),
        ("blacklist = 'a{2'", "blacklist: bad regular expression 'a{2': a { } is not complete"),
        ("decimate = '(?<=a)b'", "decimate: bad regular expression '(?<=a)b': "),
        (f"stamped = '{'a' * 1001}'", "has 1001 characters: at most 1000 are allowed"),
    ],
    ids=lambda text: str(text)[:10],
)
def test_settings_that_an_executor_would_reject_are_rejected(
    stopped_daemon: DaemonUnderTest, line: str, said: str
) -> None:
    daemon = stopped_daemon
    daemon.settings.write_text(f"[runner]\nfrequency_hz = 500.0\n[runner.ros]\n{line}\n")
    done = rtcfd(daemon, "--check-config", "--config", str(daemon.settings))
    assert (done.returncode, done.stdout) == (1, "")
    assert done.stderr.startswith(f"rtcfd: {daemon.settings}:4: {line.partition(' =')[0]}")
    assert said in done.stderr
    assert done.stderr.count("\n") == 1


def test_an_invalid_expression_fails_reload_and_start(
    stopped_daemon: DaemonUnderTest,
) -> None:
    daemon = stopped_daemon
    good = "[runner.ros]\nwhitelist = '/arm/.*'\n"
    bad = "[runner.ros]\nwhitelist = '*'\n"
    daemon.settings.write_text(good)
    daemon.start_service()
    daemon.settings.write_text(bad)
    done = rtcfd(daemon, "--reload")
    assert done.returncode == 1
    said = f"{daemon.settings}:2: whitelist: bad regular expression '*'"
    assert said in done.stderr
    daemon.end()
    daemon.start_service()
    with daemon.client() as client:
        status = client.get_status()
    assert status.runners[0].settings.ros.whitelist == "/arm/.*"
    assert status.notes[0].startswith(said)


def test_settings_of_a_graph_are_checked_together_with_the_defaults(
    stopped_daemon: DaemonUnderTest,
) -> None:
    daemon = stopped_daemon
    daemon.settings.write_text("[runner]\nfrequency_hz = 100.0\n")
    daemon.graphs.mkdir()
    graph = daemon.graphs / "a.yaml"
    check = check_of(daemon)
    # At most half a period: of 10 ms, not of the default 1 ms.
    graph.write_text("settings: {spin_us: 5000}\n" + GRAPH)
    assert rtcfd(daemon, *check).returncode == 0
    graph.write_text("settings: {spin_us: 5001}\n" + GRAPH)
    done = rtcfd(daemon, *check)
    assert (done.returncode, done.stdout) == (1, "")
    assert done.stderr.startswith(f"rtcfd: {graph}: spin 5001 ")
    graph.write_text("settings: {ros: {latch: '('}}\n" + GRAPH)
    done = rtcfd(daemon, *check)
    assert done.stderr.startswith(f"rtcfd: {graph}: latch: bad regular expression '('")
    # A start applies the other graphs.
    (daemon.graphs / "b.yaml").write_text("runner: arm\n" + GRAPH)
    daemon.start_service()
    with daemon.client() as client:
        assert client.get_order("arm") == ["/a"]
        assert any("latch: bad regular" in note for note in client.get_status().notes)
        assert not client.get_status("rt_runner").runners[0].status


def test_without_an_executor_rtcfd_checks_the_settings_itself(
    tmp_path: Path,
) -> None:
    (tmp_path / "rtcfd.toml").write_text("[runner.ros]\nlatch = '('\n")
    nobody = ["--config", str(tmp_path / "rtcfd.toml"), "--executor", str(tmp_path / "none")]
    assert options.parse(nobody, None).defaults.ros.latch == "("


def test_a_journal_line_is_complete_by_itself() -> None:
    def line(message: str, **fields: str) -> str:
        record = logging.makeLogRecord(fields)
        return standing_alone(record, message)

    assert line("ready") == "ready"
    assert line("its executor is gone", runner="arm") == "arm: its executor is gone"
    assert line("no reply", runner="arm", component="/pid") == "arm /pid: no reply"
    # No text occurs twice.
    said = "/pid: iteration 5: output out is not finite"
    assert line(said, runner="arm", component="/pid") == f"arm {said}"
    assert line("arm: stuck", runner="arm") == "arm: stuck"

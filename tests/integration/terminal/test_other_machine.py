"""`rtcfctl -H`: rtcfd of another machine through a real sshd, which here runs on this machine."""

import os
import signal
import socket
import subprocess
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
import rtcf
from daemon_process import Daemon, wait_for
from values import iteration

Ctl = Callable[..., "subprocess.CompletedProcess[str]"]


def _answers(port: int) -> bool:
    with socket.socket() as peer:
        return peer.connect_ex(("127.0.0.1", port)) == 0


@pytest.fixture(scope="module")
def way(tmp_path_factory: pytest.TempPathFactory) -> Iterator[str]:
    """Yield a replacement for ssh that knows a host `robot`."""
    folder = tmp_path_factory.mktemp("ssh")
    for key in ("host_key", "user_key"):
        command = ["ssh-keygen", "-q", "-t", "ed25519", "-N", "", "-f", str(folder / key)]
        subprocess.run(command, check=True)
    with socket.create_server(("127.0.0.1", 0)) as server:
        port = server.getsockname()[1]
    (folder / "sshd_config").write_text(
        f"ListenAddress 127.0.0.1:{port}\nHostKey {folder}/host_key\nPidFile none\n"
        f"AuthorizedKeysFile {folder}/user_key.pub\nStrictModes no\nUsePAM no\n"
        "PermitRootLogin prohibit-password\nPasswordAuthentication no\n"
    )
    (folder / "ssh_config").write_text(
        f"Host robot\n HostName 127.0.0.1\n Port {port}\n IdentityFile {folder}/user_key\n"
        f" UserKnownHostsFile {folder}/known\n StrictHostKeyChecking accept-new\n"
        " IdentitiesOnly yes\n BatchMode yes\n LogLevel ERROR\n"
    )
    Path("/run/sshd").mkdir(exist_ok=True)  # as ssh.service does
    with (
        (folder / "log").open("wb") as log,
        subprocess.Popen(
            ["/usr/sbin/sshd", "-D", "-e", "-f", str(folder / "sshd_config")], stderr=log
        ) as sshd,
    ):
        try:
            wait_for(lambda: _answers(port), "sshd")
            yield f"ssh -F {folder}/ssh_config"
        finally:
            sshd.terminate()


@pytest.fixture
def elsewhere(way: str, daemon: Daemon) -> dict[str, str]:
    """Return the environment of a user at another machine."""
    found = daemon.environment() | {"RTCF_SSH": way}
    del found["RTCF_SOCKET"]
    return found


@pytest.fixture
def ctl(elsewhere: dict[str, str], daemon: Daemon) -> Ctl:
    def run(*words: str, host: str = "robot") -> Any:
        command = ["rtcfctl", f"--host={host}", "--socket", str(daemon.socket), *words]
        return subprocess.run(command, env=elsewhere, capture_output=True, text=True, timeout=60)

    return run


def test_its_loops_can_be_queried_and_changed(ctl: Ctl, client: rtcf.Client) -> None:
    assert ctl("load", "rtcf_test", "Counter").stdout == "loaded /Counter\n"
    started = ctl("start")
    assert started.returncode == 0, started.stderr
    wait_for(lambda: iteration(client) > 10, "cycles")
    assert "running" in ctl("status").stdout
    assert ctl("stop").returncode == 0
    assert "stopped" in ctl("status").stdout


def test_files_are_local(ctl: Ctl, client: rtcf.Client, tmp_path: Path) -> None:
    ctl("load", "rtcf_test", "Counter")
    saved = ctl("save", str(tmp_path / "graph.yaml"))
    assert saved.returncode == 0, saved.stderr
    assert "Counter" in (tmp_path / "graph.yaml").read_text()
    ctl("start")
    wait_for(lambda: iteration(client) > 10, "cycles")
    recorded = ctl("record", "--duration", "0.2s", "-o", str(tmp_path / "run.mcap"))
    assert recorded.returncode == 0, recorded.stderr
    with rtcf.read_recording(tmp_path / "run.mcap") as recording:
        assert len(recording.cycles) > 10


def test_ctrl_c_ends_a_watch_and_leaves_nothing(
    elsewhere: dict[str, str], daemon: Daemon, client: rtcf.Client, tmp_path: Path
) -> None:
    client.load(rtcf.component("rtcf_test", "Counter"))
    client.start()
    folder = tmp_path / "temporary"
    folder.mkdir()
    with subprocess.Popen(
        ["rtcfctl", "-H", "robot", "--socket", str(daemon.socket), "echo", "/Counter.out"],
        env=elsewhere | {"TMPDIR": str(folder)}, stdout=subprocess.PIPE, text=True,
        # Like a terminal, which sends Ctrl-C to all foreground processes.
        start_new_session=True,
    ) as process:  # fmt: skip
        assert process.stdout is not None
        assert process.stdout.readline()
        assert list(folder.iterdir())
        os.killpg(process.pid, signal.SIGINT)
        process.stdout.read()
        assert process.wait() == 0
    assert not list(folder.iterdir())
    with pytest.raises(ProcessLookupError):
        os.killpg(process.pid, 0)


@pytest.mark.parametrize(
    ("host", "words", "code", "said"),
    [
        ("-oProxyCommand=false", ("status",), 2, "use HOST or USER@HOST, as for ssh"),
        ("", ("status",), 2, "use HOST or USER@HOST, as for ssh"),
        ("robot", ("doctor",), 2,
         "doctor works on the local machine: use ssh robot rtcfctl doctor"),
        ("robot", ("--socket", "here", "status"), 2, "use an absolute path without a colon"),
        ("nobody@robot", ("status",), 3, "ssh cannot connect to nobody@robot"),
        ("robot", ("--socket", "/nowhere/s", "status"), 3, "/nowhere/s of robot"),
    ],
)  # fmt: skip
def test_errors_are_one_line(
    ctl: Ctl, host: str, words: tuple[str, ...], code: int, said: str
) -> None:
    done = ctl(*words, host=host)
    assert done.returncode == code, done.stderr
    (line,) = (each for each in done.stderr.splitlines() if each.startswith("rtcfctl: "))
    assert said in line


def test_a_missing_ssh_is_reported(elsewhere: dict[str, str]) -> None:
    done = subprocess.run(
        ["rtcfctl", "-H", "robot", "status"], env=elsewhere | {"RTCF_SSH": "/no/ssh"},
        capture_output=True, text=True, timeout=60,
    )  # fmt: skip
    assert (done.returncode, done.stderr) == (
        1,
        "rtcfctl: cannot run /no/ssh: No such file or directory\n",
    )


def test_completion_connects_to_no_other_machine(elsewhere: dict[str, str]) -> None:
    done = subprocess.run(
        ["rtcfctl", "__complete", "-H", "robot", "info", ""], env=elsewhere | {"RTCF_SSH": "false"},
        capture_output=True, text=True, timeout=60,
    )  # fmt: skip
    assert (done.returncode, done.stdout) == (0, "")

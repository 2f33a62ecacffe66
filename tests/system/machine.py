"""The Debian booted for these tests: a copy-on-write view of the cached one."""

import contextlib
import os
import shlex
import signal
import subprocess
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

HERE = Path(__file__).parent
DEADLINE_S = 90.0
_POLL_S = 0.05
_BOOTED = ("running", "degraded")
# The environment of a login, and nothing else.
_ENVIRONMENT = ("PATH=/usr/local/sbin:/usr/local/bin:/usr/sbin:/usr/bin:/sbin:/bin",
                "LANG=C.UTF-8", "TERM=dumb", "DEBIAN_FRONTEND=noninteractive")  # fmt: skip

Done = subprocess.CompletedProcess[str]


def wait_for(condition: Callable[[], Any], what: str, deadline_s: float = DEADLINE_S) -> Any:
    """Return the condition's result once it is true; fail after the deadline."""
    deadline = time.monotonic() + deadline_s
    while not (result := condition()):
        assert time.monotonic() < deadline, f"waited {deadline_s:g} s for {what}"
        time.sleep(_POLL_S)
    return result


class Machine:
    """A booted Debian, controlled from the host as by an administrator at its console."""

    def __init__(self, root: Path, name: str, folder: Path) -> None:
        self.folder = folder / "root"  # its file system, as the host sees it
        self._name = name
        self._console = folder / "console"
        self._process: subprocess.Popen[bytes] | None = None
        self._leader = 0
        # None of its files may reach a disk or outlive the test.
        _mount("-t", "tmpfs", "rtcf-system-test", str(folder))
        for each in ("changes", "work", "root"):
            (folder / each).mkdir()
        layers = f"lowerdir={root},upperdir={folder}/changes,workdir={folder}/work"
        _mount("-t", "overlay", "overlay", "-o", layers, str(self.folder))

    def boot(self) -> None:
        """Boot it. Returns when systemd reports that it is up."""
        with self._console.open("ab") as console:
            self._process = subprocess.Popen(
                [HERE / "boot", self.folder, self._name],
                stdin=subprocess.DEVNULL,
                stdout=console,
                stderr=console,
            )

        def up() -> bool:
            assert self._process is not None
            if self._process.poll() is not None:
                raise RuntimeError(f"no Debian could be booted here: {self.console()}")
            self._leader = _systemd_under(self._process.pid)
            if not self._leader:
                return False
            return self.run("systemctl", "is-system-running", check=False).stdout.strip() in _BOOTED

        wait_for(up, "the boot")

    def reboot(self) -> None:
        """Reboot it as an administrator does. Returns when it is up again."""
        assert self._process is not None
        self.run("systemctl", "reboot", check=False)
        self._process.wait(DEADLINE_S)
        self.boot()

    def stop(self) -> None:
        """Shut it down as by its power button, and kill it if that fails."""
        if self._process is None:
            return
        with contextlib.suppress(ProcessLookupError):
            os.kill(self._leader, signal.SIGRTMIN + 3)  # systemd(1): halt
        try:
            self._process.wait(30)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()
        self._process = None

    def console(self) -> str:
        """Return its console output."""
        return self._console.read_text(errors="replace").strip()

    def command(self, *command: str, user: str = "root") -> list[str]:
        """Return the host's command that runs `command` inside."""
        as_user = ["runuser", "-u", user, "--"] if user != "root" else []
        namespaces = ("-m", "-u", "-i", "-n", "-p", "-C", "-r", "-w")
        enter = ["nsenter", "-t", str(self._leader), *namespaces]
        return [*enter, "env", "-i", *_ENVIRONMENT, *as_user, *command]

    def run(
        self,
        *command: str,
        user: str = "root",
        check: bool = True,
        text: str | None = None,
        deadline_s: float = 300.0,
    ) -> Done:
        """Run a command inside. Its output is part of the error if it fails."""
        done = subprocess.run(
            self.command(*command, user=user),
            input=text,
            stdin=subprocess.DEVNULL if text is None else None,
            capture_output=True,
            text=True,
            timeout=deadline_s,
            check=False,
        )
        if check:
            assert done.returncode == 0, (
                f"{shlex.join(command)}: status {done.returncode}\n{done.stdout}{done.stderr}"
            )
        return done

    def shell(
        self, script: str, user: str = "root", check: bool = True, deadline_s: float = 300.0
    ) -> Done:
        """Run a shell command line inside."""
        return self.run("bash", "-c", script, user=user, check=check, deadline_s=deadline_s)

    def start(self, *command: str, user: str = "root") -> "subprocess.Popen[str]":
        """Start a command inside."""
        return subprocess.Popen(
            self.command(*command, user=user),
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
        )

    def path(self, path: str) -> Path:
        """Return the host's path of a file inside; not for files in /run or /tmp."""
        return self.folder / path.lstrip("/")


def _mount(*arguments: str) -> None:
    done = subprocess.run(["mount", *arguments], capture_output=True, text=True, check=False)
    if done.returncode:
        raise RuntimeError(f"no Debian can be booted here: {done.stderr.strip()}")


def _systemd_under(pid: int) -> int:
    """Return the pid of systemd among the descendants of a process, or 0."""
    try:
        children = Path(f"/proc/{pid}/task/{pid}/children").read_text().split()
    except OSError:
        return 0
    for child in map(int, children):
        with contextlib.suppress(OSError):
            if Path(f"/proc/{child}/comm").read_text().strip() == "systemd":
                return child
        if found := _systemd_under(child):
            return found
    return 0

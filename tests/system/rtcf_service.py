"""rtcfd.service and rtcfctl of the booted machine."""

import json
import time
from typing import Any

from machine import Done, Machine, wait_for

SETTINGS = "/etc/rtcfd/rtcfd.toml"
# A container does not guarantee CPU time to real-time threads, and has other limits.
_DEGRADED = '[daemon]\nrealtime = "preferred"\n[runner.ros]\nenabled = false\n'


class Service:
    """The administrator's view: systemctl, journalctl and rtcfctl."""

    def __init__(self, machine: Machine, settings: str = _DEGRADED) -> None:
        self.machine = machine
        self._settings = settings
        self._since = time.time()

    def reset(self) -> None:
        """Restart it with an empty state and settings that work in a container."""
        self.systemctl("stop", "rtcfd.socket", "rtcfd.service")
        self.machine.shell(
            "pkill -KILL rtcf-executor; rm -rf /var/lib/rtcfd/* /etc/rtcfd/graphs.d/*; "
            "systemctl reset-failed rtcfd.service rtcfd.socket; true"
        )
        self.configure("")
        self._since = time.time()
        self.systemctl("start", "rtcfd.socket", "rtcfd.service")

    def configure(self, more: str) -> None:
        """Write the settings. They apply from the next start or reload."""
        self.machine.path(SETTINGS).write_text(self._settings + more)

    def systemctl(self, *arguments: str, check: bool = True) -> Done:
        """Call systemctl."""
        return self.machine.run("systemctl", *arguments, check=check)

    def stop_and_start(self) -> None:
        """Stop it with its loops, then start it."""
        self.systemctl("stop", "rtcfd.service")
        self.systemctl("start", "rtcfd.service")

    def unit_property(self, name: str, unit: str = "rtcfd.service") -> str:
        """Return a property of the unit."""
        return self.systemctl("show", "--value", "--property", name, unit).stdout.strip()

    @property
    def pid(self) -> int:
        """Its main process id, in the machine's PID namespace."""
        return int(self.unit_property("MainPID"))

    def ctl(self, *arguments: str, user: str = "root", check: bool = True) -> Done:
        """Call rtcfctl."""
        return self.machine.run("rtcfctl", *arguments, user=user, check=check)

    def status(self, runner: str = "rt_runner") -> dict[str, Any]:
        """Return the status of a runner."""
        document = json.loads(self.ctl("-r", runner, "-o", "json", "status").stdout)
        found: dict[str, Any] = document["runners"][0]
        return found

    def iteration(self) -> int:
        """Return the number of cycles of the loop."""
        return int(self.status().get("iteration", 0))

    def kill(self, signal: str, pid: int) -> None:
        """Send a signal to a process."""
        self.machine.run("kill", f"-{signal}", str(pid))

    def load_and_start(self) -> dict[str, Any]:
        """Load one component and start the loop; return its status."""
        self.ctl("load", "rtcf_examples", "Mimo", "--name", "M")
        self.ctl("start")
        wait_for(lambda: self.iteration() > 10, "cycles")
        return self.status()

    def journal(self, *matches: str) -> list[dict[str, Any]]:
        """Return the journal's entries of this test, as stored."""
        self.machine.run("journalctl", "--sync")
        done = self.machine.run(
            "journalctl", "--unit", "rtcfd.service", f"--since=@{self._since:.6f}",
            "--output", "json", *matches,
        )  # fmt: skip
        return [json.loads(line) for line in done.stdout.splitlines()]

    def said(self, text: str) -> bool:
        """Return whether an entry of the journal contains a text."""
        return any(text in str(entry.get("MESSAGE", "")) for entry in self.journal())

    def wait_until_said(self, text: str) -> None:
        """Wait for an entry with a text."""
        wait_for(lambda: self.said(text), f"{text!r} in the journal")

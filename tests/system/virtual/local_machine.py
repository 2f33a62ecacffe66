"""The virtual machine seen from inside, where these tests run."""

from pathlib import Path

from machine import Machine


class LocalMachine(Machine):
    """A Machine whose commands run in the same machine as the tests."""

    def __init__(self) -> None:
        self.folder = Path("/")

    def command(self, *command: str, user: str = "root") -> list[str]:
        """Return the command unchanged."""
        return [*(["runuser", "-u", user, "--"] if user != "root" else []), *command]

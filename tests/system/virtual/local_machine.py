"""The virtual machine seen from inside, where these tests run."""

from pathlib import Path

from machine import Machine


class LocalMachine(Machine):
    """What tests of a container do from outside, done on the spot."""

    def __init__(self) -> None:
        self.folder = Path("/")

    def command(self, *command: str, user: str = "root") -> list[str]:
        """Return the command itself."""
        return [*(["runuser", "-u", user, "--"] if user != "root" else []), *command]

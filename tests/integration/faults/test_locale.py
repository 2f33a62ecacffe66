"""A component that changes the locale of its process, to one that writes numbers with a comma."""

import subprocess
from pathlib import Path

import pytest
import rtcf
from daemon_process import Daemon
from values import port_value


@pytest.fixture
def german(tmp_path: Path) -> dict[str, str]:
    """Return the environment of a German process."""
    folder = tmp_path / "locales"
    folder.mkdir()
    made = folder / "de_DE.UTF-8"
    subprocess.run(["localedef", "-i", "de_DE", "-f", "UTF-8", made], check=True)
    return {"LOCPATH": str(folder), "LC_ALL": made.name}


def test_numbers_keep_their_point(tmp_path: Path, german: dict[str, str]) -> None:
    daemon = Daemon(tmp_path, environment=german)
    daemon.start()
    try:
        with rtcf.Client(daemon.socket) as client:
            client.load(rtcf.component("rtcf_faults", "SetsLocale", name="vendor"))
            table = ["x:='0 0.5 1'", "y:='0,1,3'"]
            client.load(
                rtcf.component("rtcf_control", "LookupTable", name="table", parameters=table)
            )
            client.write("table.in", 0.75)
            client.step(1)
            assert port_value(client, "/table", "out") == 2.0
            assert port_value(client, "/vendor", "half") == 0.5
    finally:
        daemon.end()

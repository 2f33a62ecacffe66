"""README's tour, run word for word."""

import re
import shlex
from pathlib import Path

from daemon_process import Daemon

README = Path(__file__).parents[2] / "README.md"


def test_the_tour_goes_as_it_is_told(daemon: Daemon) -> None:
    tour = README.read_text().partition("## A tour\n")[2].partition("\n## ")[0]
    blocks = re.findall(r"^```sh\n(.*?)^```", tour, re.MULTILINE | re.DOTALL)
    lines = [line for line in "".join(blocks).splitlines() if line.startswith("rtcfctl ")]
    assert len(lines) > 10
    for line in lines:
        done = daemon.ctl(*shlex.split(line)[1:])
        assert done.returncode == 0, (line, done.stderr)
    saved = Path("/tmp/tour.yaml")
    assert "on_boot: start" in saved.read_text()
    saved.unlink()
    assert daemon.ctl("stop").returncode == 0

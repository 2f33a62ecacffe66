"""`stop --all` asks rtcfd, even if the executors' sockets have been replaced."""

from pathlib import Path

import pytest
import rtcf
from daemon_process import DEADLINE_S
from daemon_under_test import DaemonUnderTest
from rtcf import direct_stop
from rtcf.direct_stop import Stopped
from rtcf.v1 import runner_pb2
from rtcfctl.main import main


def make_unreadable(folder: Path) -> None:
    """Make it unreadable even for root: a link to itself."""
    if folder.exists():
        folder.rename(folder.with_name("before"))
    folder.parent.mkdir(exist_ok=True)
    folder.symlink_to(folder.name)


def test_rtcfd_is_asked_if_the_executors_are_unreachable(
    daemon: DaemonUnderTest,
    client: rtcf.Client,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.setattr(direct_stop, "PATIENCE_S", DEADLINE_S)
    monkeypatch.setattr(direct_stop, "TIMEOUT_S", DEADLINE_S)
    client.start()
    for folder in direct_stop.folders(str(daemon.socket)):
        make_unreadable(folder)
    assert main(["--socket", str(daemon.socket), "stop", "--all"]) == 0
    assert capsys.readouterr() == ("rt_runner stopped\n", "")
    assert client.get_status().runners[0].state == runner_pb2.RUNNER_STATE_STOPPED
    daemon.end()
    (failed,) = client.stop_all()
    assert str(failed.error).startswith("cannot find the loops: ")
    assert "rtcfd is not running at" in str(failed.error)
    assert main(["--socket", str(daemon.socket), "stop", "--all"]) == 3


def test_an_unreadable_folder_does_not_hide_the_other(tmp_path: Path) -> None:
    socket = str(tmp_path / "s")
    ours, beside = direct_stop.folders(socket)
    make_unreadable(beside)
    with pytest.raises(rtcf.DaemonUnreachableError, match="cannot find the loops"):
        direct_stop.stop_all(socket)
    ours.mkdir(parents=True)
    (ours / "arm").touch()  # no process listens
    (failed,) = direct_stop.stop_all(socket)
    assert failed == Stopped("arm", failed.error)
    assert "no executor of runner arm found in " in str(failed.error)

"""Shell completion: verbs, options, and the names that rtcfd knows at that moment."""

import subprocess
from pathlib import Path

import pytest
import rtcf
from daemon_process import BUILD_TREE
from daemon_under_test import DaemonUnderTest
from pages import TREE
from rtcfctl import completion
from rtcfctl.main import parser

SCRIPT = TREE / "client" / "completion" / "rtcfctl"


@pytest.fixture
def offered(daemon: DaemonUnderTest) -> DaemonUnderTest:
    with daemon.client() as client:
        client.load(rtcf.component("demo", "Fine", name="alpha"))
        client.add_runner("other")
    return daemon


@pytest.mark.parametrize(
    ("line", "among"),
    [
        ("sta", ["start", "stats", "status"]),
        ("runner ", ["add", "list", "remove", "restart", "set"]),
        ("runner remove ", ["other", "rt_runner"]),
        ("-r ", ["other", "rt_runner"]),
        ("-o ", ["json", "table", "yaml"]),
        ("status --so", ["--socket"]),
        ("info al", ["alpha"]),
        ("info --type demo/F", ["demo/Fine"]),
        ("unload /", ["/alpha"]),
        ("load ", ["demo"]),
        ("load demo F", ["Fine"]),
        ("-r other info ", [""]),
        ("load demo Fine --param ", ["kp:="]),
        ("replace alpha demo Fine --param k", ["kp:="]),
        ("load demo Fine --remap ", ["in1:=", "out1:="]),
        ("load demo Fine --break ", ["in1"]),
        ("load demo --param ", [""]),
        ("load observer.py --no", ["--no-verify"]),
        ("run observer.py Observer --no", ["--no-start", "--no-verify"]),
        ("load demo Nothing --param ", [""]),
        ("set alpha ", ["kp:="]),
        ("history al", ["alpha"]),
        ("history alpha ", ["kp"]),
        ("undo al", ["alpha"]),
        ("break ", ["alpha.in1"]),
        ("get al", ["alpha"]),
        ("wait al", ["alpha.out1"]),
        ("nonsense ", [""]),
        ("help stat", ["stats", "status"]),
    ],
)
def test_the_last_word_is_completed(offered: DaemonUnderTest, line: str, among: list[str]) -> None:
    done = offered.ctl("__complete", *line.split(" "))
    assert (done.returncode, done.stderr) == (0, "")
    assert done.stdout.removesuffix("\n").split("\n") == among


def test_bash_asks_rtcfctl(offered: DaemonUnderTest) -> None:
    test = (
        f"source {SCRIPT}; COMP_WORDS=(rtcfctl info al); COMP_CWORD=2; _rtcfctl; "
        "echo ${COMPREPLY[@]}"
    )
    done = subprocess.run(
        ["bash", "-c", test],
        env={"PATH": f"{BUILD_TREE}/bin:/usr/bin:/bin", "RTCF_SOCKET": str(offered.socket)},
        capture_output=True,
        text=True,
        check=True,
    )
    assert done.stdout.split() == ["alpha"]


def test_without_rtcfd_completion_is_silent_and_empty(tmp_path: Path) -> None:
    done = subprocess.run(
        [BUILD_TREE / "bin" / "rtcfctl", "__complete", "info", ""],
        env={"RTCF_SOCKET": str(tmp_path / "none")},
        capture_output=True,
        text=True,
        check=True,
    )
    assert (done.stdout.strip(), done.stderr) == ("", "")


@pytest.mark.parametrize("active", [True, False])
def test_completion_starts_no_daemon(
    offered: DaemonUnderTest, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, active: bool
) -> None:
    systemctl = tmp_path / "bin" / "systemctl"
    systemctl.parent.mkdir()
    systemctl.write_text(f"#!/bin/sh\nexit {0 if active else 3}\n")
    systemctl.chmod(0o755)
    monkeypatch.setenv("PATH", f"{systemctl.parent}:/usr/bin:/bin")
    monkeypatch.setenv("RTCF_SOCKET", str(offered.socket))
    monkeypatch.setattr(completion, "DEFAULT_SOCKET", str(offered.socket))
    found = completion.candidates(parser(), ["-r", ""])
    assert found == (["other", "rt_runner"] if active else [])

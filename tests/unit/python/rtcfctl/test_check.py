"""`rtcfctl check`: sanitizer reports, libraries, exit codes."""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest
from daemon_process import BUILD_TREE
from pages import SUPPORT, TREE
from rtcf import checking
from rtcf.errors import RtcfError
from rtcf.sanitizer import Frame, violations

REPORT = """\
/checked: hello
==12==ERROR: RealtimeSanitizer: unsafe-library-call
Intercepted call to real-time unsafe function `malloc` in real-time context!
    #0 0x55d0 in malloc (/usr/lib/rtcf/rtcf-executor-rtsan+0xf0a2d) (BuildId: 09ab)
    #1 0x7f12 in operator new(unsigned long) (/lib/libstdc++.so.6+0xa1) (BuildId: 77)
    #2 0x7f13 in (anonymous namespace)::Pid::grow(int) /src/my pkg/pid.cpp:22:40
    #3 0x7f14 in Base::update() /src/base.hpp:7 (discriminator 8)
    #4 0x55d1 in rtcf::executor::(anonymous namespace)::call(rtcf::Component&) /b/loop.cpp:90:20
    #5 0x7f15  (<unknown module>)

SUMMARY: RealtimeSanitizer: unsafe-library-call /src/my pkg/pid.cpp:22:40 in Pid::grow
noise
==12==ERROR: RealtimeSanitizer: blocking-call
Call to blocking function `wait()` in real-time context!
    #0 0x1 in __rtsan_notify_blocking_call (/x+0x1)
    #1 0x2 (/lib/pid.so+0x12)
    #2 0x3 in rtcf::executor::Loop::run() /b/loop.cpp:1
SUMMARY: RealtimeSanitizer: blocking-call
rtcf_test/Pid: 1000 cycles
"""


def test_reports_are_read_from_the_call_to_the_update() -> None:
    first, second = violations(REPORT.splitlines())
    assert (first.kind, first.called) == ("unsafe-library-call", "malloc")
    assert first.component_frames == [
        Frame("operator new(unsigned long)"),
        Frame("(anonymous namespace)::Pid::grow(int)", "/src/my pkg/pid.cpp", 22),
        Frame("Base::update()", "/src/base.hpp", 7),
    ]
    assert second.called == "wait()"
    assert second.component_frames == [Frame("(/lib/pid.so+0x12)")]


@pytest.fixture
def executor(tmp_path: Path) -> Path:
    """An executor that offers type T and prints as its environment demands."""
    (tmp_path / "lib" / "pkg").mkdir(parents=True)
    (tmp_path / "lib" / "pkg" / "main.so").write_text('{"types": {"T": "fine"}}')
    peer = SUPPORT / "peer_executor.py"
    script = tmp_path / "executor"
    script.write_text(
        "#!/bin/sh\n"
        f'[ "$1" = --check ] || PYTHONPATH={BUILD_TREE}/python exec {sys.executable} {peer} "$@"\n'
        f'echo "$@" >{tmp_path}/arguments\n'
        'printf %s "$SAYS" >&2\n'
        "exit $STATUS\n"
    )
    script.chmod(0o755)
    return script


def check(
    executor: Path, *arguments: str, says: str = "", status: int = 0
) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [
            *(str(BUILD_TREE / "bin" / "rtcfctl"), "check", *arguments),
            *("--executor", str(executor), "--path", str(executor.with_name("lib"))),
        ],
        env=os.environ | {"SAYS": says, "STATUS": str(status)},
        capture_output=True,
        text=True,
        check=False,
    )


def test_a_clean_component_is_exit_code_0(executor: Path) -> None:
    done = check(executor, "pkg", "T", "--cycles", "50", "--param", "kp:=2")
    assert (done.returncode, done.stdout) == (0, "pkg/T: clean in 50 cycles\n"), done.stderr
    library = executor.with_name("lib") / "pkg" / "main.so"
    assert executor.with_name("arguments").read_text() == (
        f"--check {library} --package pkg --type T --cycles 50 --param kp:=2\n"
    )


def test_violations_are_exit_code_1_with_their_stacks(executor: Path) -> None:
    done = check(executor, "pkg", "T", says=REPORT)
    assert done.returncode == 1
    assert "1. malloc\n" in done.stdout
    assert "   Base::update()  /src/base.hpp:7\n" in done.stdout
    assert "loop.cpp" not in done.stdout
    assert done.stderr == (
        "/checked: hello\nrtcfctl: pkg/T: 2 calls that are not real-time safe in 1000 cycles\n"
    )
    found = json.loads(check(executor, "pkg", "T", "-o", "json", says=REPORT).stdout)
    assert [each["called"] for each in found["violations"]] == ["malloc", "wait()"]


@pytest.mark.parametrize(
    ("words", "says", "status", "text"),
    [
        ("pkg T", "rtcf-executor: T.configure failed\n", 1, "T.configure failed"),
        ("pkg T", "", 3, "exit status 3"),
        ("pkg U", "", 0, 'no type "U" in package "pkg" (types: T)'),
        ("pgk T", "", 0, 'no package "pgk"'),
    ],
)
def test_uncheckable_components_are_rejected(
    executor: Path, words: str, says: str, status: int, text: str
) -> None:
    done = check(executor, *words.split(), says=says, status=status)
    assert done.returncode == 1
    assert text in done.stderr


def test_a_missing_executor_in_a_build_tree_names_the_build_command(tmp_path: Path) -> None:
    with pytest.raises(RtcfError, match=f"build it with `make -C {tmp_path} checker`"):
        checking.check(
            checking.executor_of(tmp_path / "build"), "pkg", "T", 1, build_tree=tmp_path / "build"
        )
    goals = (TREE / "Makefile").read_text()
    assert "\nchecker: " in goals


def test_a_missing_executor_names_the_package(executor: Path) -> None:
    executor.unlink()
    done = check(executor, "pkg", "T")
    assert (done.returncode, "install rtcf-check" in done.stderr) == (1, True)


def test_text_output_omits_the_inside_of_libraries() -> None:
    report = """\
==1==ERROR: RealtimeSanitizer: unsafe-library-call
Intercepted call to real-time unsafe function `malloc` in real-time context!
    #0 0x1 in malloc ??:?
    #1 0x2 in operator new(unsigned long) ??:0
    #2 0x3 in std::allocator<char>::allocate(unsigned long) /usr/include/c++/12/a.h:1
    #3 0x4 in std::vector<char>::vector(unsigned long) /usr/include/c++/12/v.h:2
    #4 0x5 in Grow::update() /src/grow.cpp:3
    #5 0x6 in bool rtcf::executor::Loop::update<true>(long) /b/loop.cpp
"""
    (found,) = violations(report.splitlines())
    assert [frame.function for frame in found.short_frames] == [
        "operator new(unsigned long)",
        "std::vector<char>::vector(unsigned long)",
        "Grow::update()",
    ]
    assert found.frames[0] == Frame("malloc")
    assert found.frames[-1] == Frame("bool rtcf::executor::Loop::update<true>(long)")
    assert not found.of_executor
    gone = report.splitlines()
    del gone[3:7]
    (found,) = violations(gone)
    assert (found.component_frames, found.of_executor) == ([], False)

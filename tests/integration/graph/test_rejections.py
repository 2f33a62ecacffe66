"""Errors: one clear line, exit code 1, and no change; with the loop stopped, and running."""

import json
import re
import shlex
import shutil
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import pytest
import rtcf
from daemon_process import BUILD_TREE, Daemon, wait_for
from rtcf.v1 import runner_pb2
from rtcfctl.terminal.plain import plain
from values import iteration

MIMO = "rtcf_examples Mimo"
IDENTITY = "rtcf_examples Identity"
TEST = "rtcf_test"
NEW = f"load {MIMO} --name new"


@dataclass(frozen=True)
class Rejection:
    """A command, and the words that its error line must contain, in any order."""

    command: str
    words: list[str] = field(default_factory=list)


# The graph: a writes /x, b reads it; knobs has parameters of all types.
GRAPH = [
    f"load {MIMO} --name a --remap out1:=/x",
    f"load {MIMO} --name b --ns /arm --remap in1:=/x --remap out1:=/y",
    f"load {TEST} Knobs --name knobs --param rate:=2.5",
]

REJECTIONS = {
    "unknown package": Rejection(
        "load rtcf_exampels Mimo", ['"rtcf_exampels"', 'did you mean "rtcf_examples"']
    ),
    "unknown type": Rejection("load rtcf_examples Minmo", ['"Minmo"', '"Mimo"?', "Identity"]),
    "malformed package": Rejection("load ../etc Mimo", ['"../etc"', "letters"]),
    "library that does not load": Rejection(
        f"load {TEST} Unresolved",
        ["rtcf_test_unresolved.so", "rtcf_test_symbol_that_nobody_has", "build it again"],
    ),
    "library of another ABI": Rejection(
        f"load {TEST} OtherAbi", ["rtcf_test_other_abi.so", "ABI 4711", "build it again"]
    ),
    "constructor that throws": Rejection(
        f"load {TEST} ThrowingConstructor",
        ["ThrowingConstructor", "constructor", "no constructor should do this"],
    ),
    "configure that says why it fails": Rejection(
        f"load {TEST} FailingConfigure --name grip",
        ["/grip", "configure", "/dev/gripper does not answer: is it plugged in?"],
    ),
    "configure that returns false": Rejection(
        f"load {TEST} SilentConfigure", ["/SilentConfigure", "configure", "returned false"]
    ),
    "configure that throws": Rejection(
        f"load {TEST} ThrowingConfigure",
        ["/ThrowingConfigure", "configure", "threw", "the calibration is from yesterday"],
    ),
    "configure that throws no std::exception": Rejection(
        f"load {TEST} OddlyThrowingConfigure", ["/OddlyThrowingConfigure", "configure", "threw"]
    ),
    "replacement that fails to configure": Rejection(
        f"replace a {TEST} FailingConfigure", ["/a", "configure", "/dev/gripper"]
    ),
    "duplicate name": Rejection(f"load {MIMO} --name a", ["/a", "loaded already", "--name"]),
    "duplicate name in a namespace": Rejection(f"load {MIMO} --name b --ns arm", ["/arm/b"]),
    "illegal name": Rejection(f"load {MIMO} --name a/b", ["'a/b'", "--ns"]),
    "illegal remap": Rejection(f"{NEW} --remap in1:=1x", ["in1:=1x", "'1x'"]),
    "type mismatch at an input": Rejection(
        f"load {TEST} Counter --name count --remap in:=/x",
        ["/x", "/a.out1", "std_msgs/Float64", "/count.in", "int32", "remap"],
    ),
    "type mismatch at an output": Rejection(
        "load rtcf_examples PaperExample --name paper --remap out_port:=/arm/in2",
        ["/arm/in2", "/arm/b.in2", "std_msgs/Float64", "/paper.out_port", "std_msgs/Float32"],
    ),
    "second writer": Rejection(
        f"{NEW} --remap out2:=/x", ["/x", "two writers", "/a.out1", "/new.out2", "--remap"]
    ),
    "a loop": Rejection(
        f"load {IDENTITY} --name new --remap in:=/y --remap out:=/in1",
        ["/a.out1 → /arm/b.in1", "/arm/b.out1 → /new.in", "/new.out → /a.in1",
         "rtcfctl break a.in1", "rtcfctl break /arm/b.in1", "--break in"],
    ),
    "a loop of one": Rejection(
        f"load {IDENTITY} --name new --remap in:=/z --remap out:=/z",
        ["/new.out → /new.in", "--break in"],
    ),
    "unknown component": Rejection("unload nobody", ["/nobody", "/a", "/arm/b"]),
    "unknown component to set": Rejection("set nobody rate:=1.0", ["/nobody"]),
    "unknown component to replace": Rejection(f"replace nobody {MIMO}", ["/nobody"]),
    "unknown component to look at": Rejection("info nobody", ["/nobody"]),
    "one unknown component of two": Rejection("unload a nobody", ["/nobody"]),
    "unknown input to break": Rejection("break a.out1", ["/a", "out1", "in1, in2"]),
    "one unknown input of two": Rejection("break a.in1 a.in9", ["/a", "in9"]),
    "unknown input to load with a break": Rejection(f"{NEW} --break in9", ["/new", "in9"]),
    "unknown runner": Rejection("-r rt_runer start", ['"rt_runer"', "rt_runner"]),
    "unknown runner to load into": Rejection(f"-r arm {NEW}", ['"arm"', "rt_runner"]),
    "unknown runner to set": Rejection("runner set arm --frequency 5", ['"arm"', "rt_runner"]),
    "unknown runner to remove": Rejection("runner remove arm", ['"arm"', "rt_runner"]),
    "runner that is there already": Rejection("runner add rt_runner", ["rt_runner", "already"]),
    "illegal name of a runner": Rejection("runner add ../x", ['"../x"', "letters"]),
    "frequency of 0": Rejection("runner set --frequency 0", ["0 Hz", "0.1 to 50000 Hz"]),
    "frequency too high": Rejection("runner set --frequency 50001", ["50001 Hz", "0.1 to 50000"]),
    "negative frequency": Rejection("runner set --frequency=-5", ["-5 Hz", "0.1 to 50000"]),
    "frequency that is no number": Rejection("runner set --frequency nan", ["nan Hz", "0.1 to"]),
    "new runner with a bad frequency": Rejection(
        "runner add arm --frequency 1e9", ["0.1 to 50000"]
    ),
    "CPU that is not there": Rejection("runner set --cpu 4000", ["CPU 4000", "-1"]),
    "priority out of range": Rejection("runner set --priority 99", ["priority of 99", "1 to 98"]),
    "bad expression to ignore": Rejection(f"{NEW} --ignore '['", ["ignore", "/new", "'['"]),
    "bad whitelist": Rejection("runner set --whitelist '(a'", ["whitelist", "'(a'"]),
    "bad blacklist": Rejection("runner set --blacklist '*x'", ["blacklist", "'*x'"]),
    "value below its minimum": Rejection(
        "set knobs rate:=-1.5", ["/knobs", "rate", "-1.5", "minimum", "-1 m/s"]
    ),
    "value above its maximum": Rejection("set knobs count:=11", ["/knobs", "count", "11", "10"]),
    "value of another type": Rejection("set knobs count:=1.5", ["count", "an int", "a double"]),
    "text for a bool": Rejection(
        "set knobs enabled:=perhaps", ["enabled", "a bool", 'the text "perhaps"']
    ),
    "a number that is none, as text": Rejection("set knobs rate:=nan", ["rate", 'the text "nan"']),
    "one parameter twice": Rejection("set knobs count:=1 count:=2", ["count", "twice"]),
    "one parameter twice at a load": Rejection(
        f"load {TEST} Knobs --name k --param count:=1 --param count:=2", ["count", "twice"]
    ),
    "graph file without an end": Rejection("apply /dev/zero", ["/dev/zero", "more than 16 MiB"]),
    "snapshot without an end": Rejection("restore /dev/zero", ["/dev/zero", "more than 16 MiB"]),
    "not a number": Rejection("set knobs rate:=.nan", ["rate", "finite"]),
    "unknown enumerator": Rejection("set knobs mode:=walk", ["mode", "walk", "idle, run"]),
    "unknown parameter": Rejection("set knobs speed:=1.0", ["/knobs", "speed", "rate"]),
    "one bad value of two": Rejection("set knobs count:=3 rate:=1e6", ["rate", "1000 m/s"]),
    "bad value at load": Rejection(
        f"load {TEST} Knobs --name k --param count:=-1", ["/k", "count"]
    ),
    "bad type at load": Rejection(f"load {TEST} Knobs --name k --param rate:=fast", ["/k", "rate"]),
    "unknown parameter at load": Rejection(
        f"load {TEST} Knobs --name k --param speed:=1.0", ["/k", "speed", "enabled"]
    ),
}  # fmt: skip


@dataclass(frozen=True)
class Loaded:
    """A daemon with GRAPH, shared by all errors, none of which may change it."""

    daemon: Daemon
    client: rtcf.Client
    state: list[Any]


def state_of(client: rtcf.Client) -> list[Any]:
    """Return all state that an error must not change, as printed by `rtcfctl -o json`."""
    runners = client.get_status().runners
    for runner in runners:
        # These change by themselves, or with the load of the machine.
        for figure in ("iteration", "overruns", "missed", "late", "log_dropped"):
            runner.ClearField(figure)
    return [
        client.get_order(),
        [plain(each) for each in client.list_components()],
        [plain(each) for each in client.list_connections()],
        [plain(each) for each in client.get_component("knobs").parameters],
        [plain(each) for each in runners],
    ]


@pytest.fixture(scope="module", params=["stopped", "running"])
def loaded(
    request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory
) -> Iterator[Loaded]:
    daemon = Daemon(tmp_path_factory.mktemp("rejections"))
    daemon.start()
    for command in GRAPH:
        done = daemon.ctl(*shlex.split(command))
        assert done.returncode == 0, done.stderr
    with rtcf.Client(daemon.socket) as client:
        if request.param == "running":
            client.start()
        yield Loaded(daemon, client, state_of(client))
    daemon.end()


@pytest.mark.parametrize("rejection", REJECTIONS.values(), ids=REJECTIONS)
def test_errors_are_one_line_and_change_nothing(loaded: Loaded, rejection: Rejection) -> None:
    done = loaded.daemon.ctl(*shlex.split(rejection.command))
    assert done.returncode == 1, done
    assert done.stdout == ""
    assert re.fullmatch(r"rtcfctl: [^\n]+\n", done.stderr), done.stderr
    for word in rejection.words:
        assert word in done.stderr
    assert state_of(loaded.client) == loaded.state


def test_errors_do_not_stop_the_loop(loaded: Loaded) -> None:
    status = loaded.client.get_status("rt_runner").runners[0]
    if status.state == runner_pb2.RUNNER_STATE_STOPPED:
        assert status.iteration == 0
    else:
        wait_for(lambda: iteration(loaded.client) > status.iteration + 100, "100 cycles")


def test_each_suggested_break_makes_the_load_succeed(daemon: Daemon) -> None:
    load_a = f"load {IDENTITY} --name a --remap in:=/y --remap out:=/x"
    load_b = f"load {IDENTITY} --name b --remap in:=/x --remap out:=/y"
    assert daemon.ctl(*load_a.split()).returncode == 0
    refused = daemon.ctl(*load_b.split())
    assert refused.returncode == 1
    (command,) = re.findall(r"`(rtcfctl break [^`]+)`", refused.stderr)
    (option,) = re.findall(r"`(--break [^`]+)`", refused.stderr)

    assert daemon.run(*shlex.split(command)).returncode == 0
    assert daemon.ctl(*load_b.split()).returncode == 0
    assert daemon.ctl("order").stdout.split() == ["/a", "/b"]
    assert "loop break" in daemon.ctl("connections").stdout

    assert daemon.ctl("unload", "b").returncode == 0
    assert daemon.ctl("unbreak", "a.in").returncode == 0
    assert daemon.ctl(*load_b.split()).returncode == 1
    assert daemon.ctl(*load_b.split(), *shlex.split(option)).returncode == 0
    assert daemon.ctl("order").stdout.split() == ["/b", "/a"]


def test_removing_the_last_break_of_a_loop_is_rejected(daemon: Daemon) -> None:
    daemon.ctl(*f"load {IDENTITY} --name a --remap in:=/y --remap out:=/x --break in".split())
    daemon.ctl(*f"load {IDENTITY} --name b --remap in:=/x --remap out:=/y".split())
    refused = daemon.ctl("unbreak", "a.in")
    assert refused.returncode == 1
    assert "/b.out → /a.in" in refused.stderr
    assert daemon.ctl("order").stdout.split() == ["/a", "/b"]


def test_a_failed_start_hook_leaves_the_loop_stopped(daemon: Daemon) -> None:
    daemon.ctl("load", TEST, "Witness")
    daemon.ctl("load", TEST, "FailingStart", "--name", "last")
    refused = daemon.ctl("start")
    assert refused.returncode == 1
    assert refused.stderr == (
        "rtcfctl: /last (rtcf_test/FailingStart): start failed: the emergency stop is pressed\n"
    )
    (runner,) = json.loads(daemon.ctl("runner", "list", "-o", "json").stdout)
    assert (runner["state"], runner["iteration"]) == ("stopped", 0)
    # Components that had started are stopped again.
    wait_for(lambda: "hook stop" in daemon.log(), "the stop hook")


def test_a_component_that_fails_to_start_is_not_loaded_into_a_running_loop(daemon: Daemon) -> None:
    daemon.ctl("load", TEST, "Counter")
    daemon.ctl("start")
    before = daemon.ctl("list", "-o", "json").stdout
    refused = daemon.ctl("load", TEST, "FailingStart")
    assert refused.returncode == 1
    assert "start failed: the emergency stop is pressed" in refused.stderr
    assert daemon.ctl("list", "-o", "json").stdout == before


def test_advice_for_untrusted_folders_widens_no_rights(tmp_path: Path) -> None:
    folder = tmp_path / "packages"
    shutil.copytree(BUILD_TREE / "lib" / "rtcf" / "rtcf_examples", folder / "open" / "rtcf_open")
    (folder / "open" / "rtcf_open").chmod(0o777)
    daemon = Daemon(tmp_path, arguments=["--path", str(folder / "open")])
    daemon.start()
    try:
        said = daemon.ctl("load", "rtcf_open", "Mimo").stderr
    finally:
        daemon.end()
    assert "rtcf_open can be written by everybody, so its code is not trusted" in said
    assert "install it as root (components into /usr/lib/rtcf-components/PACKAGE)" in said
    assert "chmod" not in said and "chown" not in said

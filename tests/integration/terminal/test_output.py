"""rtcfctl's output for programs: JSON and YAML of each verb."""

import json
import os
import re
import shlex
from pathlib import Path

import pytest
import yaml
from daemon_process import Daemon

# In an order in which each command succeeds.
SESSION = [
    "status",
    "types",
    "types rtcf_examples --long",
    "info --type rtcf_examples/Mimo",
    "runner add arm --frequency 100 --no-ros",
    "runner set arm --frequency 200",
    "runner list",
    "load rtcf_examples Mimo --name a --remap out1:=/x",
    "load rtcf_examples Identity --name b --ns /arm --remap in:=/x --ignore '/x'",
    "load rtcf_test Knobs --name knobs --param rate:=2.5",
    "set knobs count:=3 'label:=a \"b\" µ'",
    "break a.in1",
    "unbreak a.in1",
    "list",
    "order",
    "connections",
    "info knobs",
    "step 10",
    "info a",
    "start",
    "stats",
    "stats --reset",
    "replace a rtcf_examples Mimo",
    "unload a /arm/b",
    "stop",
    "runner remove arm",
]

# Events in a loop with faults, and rejected commands; each fault is different.
FAULTY_SESSION = [
    "load rtcf_faults NotFinite --name odd --param after:=3",
    "load rtcf_faults Throws --name jumps --param after:=3 --optional",
    "status",
    "list",
    "info odd",
    "info jumps",
    "stats",
    "runner list",
    "step 3",
    "load rtcf_test Knobs --name other --param nope:=1",
    "load rtcf_test Knobs --name other --remap nope:=1",
    "load rtcf_test Knobs --name odd",
    "load rtcf_test FailingConfigure",
    "load rtcf_test Unresolved",
    "load rtcf_test Nothing",
    "load nothing Nothing",
    "set odd after:=x",
    "unload nobody",
    "runner remove nobody",
    "stop",
    "runner set rt_runner --realtime required",
    "start",
    "status",
]
# Without real-time rights.
NO_RIGHTS = ("setpriv", "--inh-caps=-all", "--bounding-set=-sys_nice,-ipc_lock,-sys_resource",
             "prlimit", "--rtprio=0", "--memlock=65536")  # fmt: skip
CLAUSES = re.compile(r"\n|  +|; |, |(?<=\w): |[()]")


@pytest.mark.parametrize("kind", ["json", "yaml"])
def test_each_verb_has_json_and_yaml_output(daemon: Daemon, kind: str) -> None:
    for command in SESSION:
        done = daemon.ctl(*shlex.split(command), "-o", kind)
        assert done.returncode == 0, (command, done.stderr)
        assert done.stdout.strip(), command
        found = json.loads(done.stdout) if kind == "json" else yaml.safe_load(done.stdout)
        assert isinstance(found, dict | list), command


def test_values_have_their_declared_types(daemon: Daemon) -> None:
    daemon.ctl("load", "rtcf_test", "Knobs", "--name", "k", "--param", "label:='5'")
    daemon.ctl("step", "1")
    found = json.loads(daemon.ctl("info", "k", "-o", "json").stdout)
    parameters = {each["name"]: each for each in found["parameters"]}
    assert [(p["type"], p["value"]) for p in parameters.values()] == [
        ("bool", True), ("int", 2), ("double", 1.5), ("string", "5"), ("enum", "run"),
    ]  # fmt: skip
    rate = parameters["rate"]
    assert (rate["minimum"], rate["maximum"], rate["unit"]) == (-1.0, 1000.0, "m/s")
    assert parameters["mode"]["choices"] == ["idle", "run"]
    assert parameters["enabled"]["minimum"] is None
    ports = {each["name"]: each for each in found["ports"]}
    assert ports["product"]["value"] == {"data": 3}
    assert ports["product"]["direction"] == "output"


def test_no_answer_repeats_a_line(tmp_path: Path) -> None:
    daemon = Daemon(tmp_path, wrapper=NO_RIGHTS if os.geteuid() == 0 else NO_RIGHTS[3:])
    daemon.start()
    try:
        # `types` lists the same missing library several times.
        for command in [each for each in SESSION[:-2] if each != "types"] + FAULTY_SESSION:
            done = daemon.ctl("-v", *shlex.split(command))
            answer = f"{done.stdout}\n{done.stderr}"
            clauses = [each.strip(" !") for each in CLAUSES.split(answer)]
            clauses = [each for each in clauses if len(each.split()) > 3]
            assert len(clauses) == len(set(clauses)), f"{command}: {answer}"
            if command == "start" and done.returncode == 0:
                assert "IS NOT REAL TIME" in answer
    finally:
        daemon.end()

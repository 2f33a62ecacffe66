"""Graph files: parsing, errors, writing; `rtcfctl apply` and `save`."""

import os
import stat
import subprocess
from pathlib import Path

import pytest
import rtcf
import yaml
from daemon_process import BUILD_TREE
from daemon_under_test import DaemonUnderTest
from hypothesis import example, given, seed, settings
from hypothesis import strategies as st
from rtcf.v1 import graph_pb2, runner_pb2

SEED = int(os.environ.get("RTCF_SEED", "1"))

FULL = """\
runner: arm
settings:
  frequency_hz: 2000
  overrun: catch_up
  ros: {whitelist: '/a|/b', enabled: true}
components:
  - name: H1
    ns: /left
    package: demo
    type: Fine
    remaps: {in1: /x, out1: ~out}
    parameters: {kp: 1.5e-3, n: 0x10, on: yes, text: '12', big: -.inf}
    first: true
    ignore: '/F.*'
    breaks: [in1]
    every: 4
    phase: 1
    optional: true
  - {package: demo, type: Fine}
"""


def test_every_key_is_read() -> None:
    (graph,) = rtcf.read_graphs(FULL, "x")
    assert graph.runner == "arm"
    assert graph.settings == runner_pb2.RunnerSettings(
        frequency_hz=2000.0,
        overrun=runner_pb2.OVERRUN_POLICY_CATCH_UP,
        ros=runner_pb2.RosSettings(whitelist="/a|/b", enabled=True),
    )
    assert graph.components == [
        rtcf.component(
            "demo", "Fine", name="H1", ns="/left", remaps=["in1:=/x", "out1:=~out"],
            parameters=["kp:=1.5e-3", "n:=16", "on:=yes", "text:='12'", "big:=-.inf"],
            first=True, ignore="/F.*", breaks=["in1"], every=4, phase=1, optional=True,
        ),
        rtcf.component("demo", "Fine"),
    ]  # fmt: skip


def test_mappings_are_groups_of_parameters_and_lists_are_arrays() -> None:
    gains = "gains: {p: 2, filter: {order: 4}, k: [1.5, 2]}, gains/i: 5"
    written = f"{{{gains}, a: [[1, 2], [3, 4]], none: []}}"
    text = f"components: [{{package: p, type: T, parameters: {written}}}]"
    (graph,) = rtcf.read_graphs(text, "x")
    names = ["gains/p:=2", "gains/filter/order:=4", "gains/k_0:=1.5", "gains/k_1:=2"]
    names += ["gains/i:=5", "a_0_0:=1", "a_0_1:=2", "a_1_0:=3", "a_1_1:=4"]
    (spec,) = graph.components
    assert list(spec.parameters) == list(rtcf.component("p", "T", parameters=names).parameters)
    lists = {each.name: each.length for each in spec.lists}
    assert lists == {"gains/k": 2, "a": 2, "a_0": 2, "a_1": 2, "none": 0}
    (again,) = rtcf.read_graphs(rtcf.write_graphs([graph]), "y")
    assert {each.name: each.value for each in again.components[0].parameters} == {
        each.name: each.value for each in spec.parameters
    }
    assert {each.name: each.length for each in again.components[0].lists} == lists


def test_several_runners_are_read() -> None:
    text = "runners:\n  a: {components: []}\n  b:\n    components: [{package: p, type: T}]\n"
    a, b = rtcf.read_graphs(text, "x")
    assert (a.runner, a.components) == ("a", [])
    assert (b.runner, b.components[0].type) == ("b", "T")


@pytest.mark.parametrize(
    ("text", "line", "problem"),
    [
        ("", None, "it has no graph"),
        ("[]", 1, "the file must be a mapping"),
        ("a: ]", 1, "expected"),
        ("a: 1\n---\nb: 2\n", 2, "another document|single document"),
        ("runner: r\n", 1, "components is missing"),
        ("components: []\nsetings: {}\n", 2, 'unknown key "setings".*did you mean "settings"'),
        ("components: []\ncomponents: []\n", 2, '"components" occurs twice'),
        ("components: {}\n", 1, "components must be a list"),
        ("components:\n  - Mimo\n", 2, "a component must be a mapping"),
        ("components:\n  - type: T\n", 2, "needs its package"),
        ("components:\n- package: p\n  type: T\n  frist: true\n", 4, 'did you mean "first"'),
        ("components:\n- package: p\n  type: T\n  first: yes\n", 4, "true or false, not yes"),
        ("components:\n- package: p\n  type: T\n  every: 1.5\n", 4, "an integer, not 1.5"),
        ("components:\n- package: p\n  type: T\n  every: -1\n", 4, "every is out of range: -1"),
        ("components:\n- package: p\n  type: T\n  name: 12\n", 4, "text, not 12; quote it"),
        ("components:\n- package: p\n  type: T\n  remaps: [a]\n", 4, "remaps must be a mapping"),
        ("components:\n- package: p\n  type: T\n  parameters: {k: }\n", 4, "k has no value"),
        ("components:\n- package: p\n  type: T\n  parameters: {g: {a: {}}}\n", 4, "g/a is empty"),
        ("components:\n- package: p\n  type: T\n  parameters: {g: {a: }}\n", 4, "g/a has no value"),
        ("components:\n- package: p\n  type: T\n  parameters:\n    g/a: 1\n    g: {a: 2}\n", 6,
         "parameters.g/a is set twice"),
        ("components:\n- package: p\n  type: T\n  parameters:\n    g/a: []\n    g: {a: []}\n", 6,
         "parameters.g/a is set twice"),
        ("components:\n- package: p\n  type: T\n  parameters:\n    g/a: 1\n    g: {a: [2]}\n", 6,
         "parameters.g/a is set twice"),
        ("components:\n- package: p\n  type: T\n  parameters:\n    g/a: [2]\n    g: {a: 1}\n", 6,
         "parameters.g/a is set twice"),
        ("components:\n- package: p\n  type: T\n  parameters: {a: &x {b: *x}}\n", 4,
         "more than 100 mappings or lists in each other"),
        ("components:\n- package: p\n  type: T\n  parameters: " + "{k: [" * 90_000, 4,
         "more than 100 mappings or lists in each other"),
        ("- " * 200_000 + "1", 1, "more than 100 mappings or lists in each other"),
        ("components:\n- package: p\n  type: T\n  parameters:\n    a: &a [" + "1," * 100
         + "]\n    b: &b [" + "*a," * 100 + "]\n    c: [" + "*b," * 100 + "]\n", 5,
         "more than 10000 parameters"),
        ("components:\n- package: p\n  type: T\n  parameters: {k: 9e}\n  breaks: in1", 5, "a list"),
        ("components:\n- {package: p, type: T}\n- {package: p, type: T, ns: /}\n", 3,
         "component /T is already in line 2"),
        ("settings: {frequency_hz: fast}\ncomponents: []\n", 1, "frequency_hz must be a number"),
        ("settings: {overrun: never}\ncomponents: []\n", 1, "one of skip, catch_up, relative"),
        ("settings:\n  ros: {queu: 1}\ncomponents: []\n", 2, 'did you mean "queue"'),
        ("settings: {priority: -1}\ncomponents: []\n", 1, "priority is out of range"),
        ("runners: {}\ncomponents: []\n", 2, 'unknown key "components" beside runners'),
        ("runners: {a: {runner: b, components: []}}\n", 1, 'unknown key "runner" of runner a'),
    ],
)  # fmt: skip
def test_an_error_is_reported_with_its_line(text: str, line: int | None, problem: str) -> None:
    place = r"g\.yaml: " if line is None else rf"g\.yaml:{line}: "
    with pytest.raises(rtcf.GraphFileError, match=f"{place}.*({problem})"):
        rtcf.read_graphs(text, "g.yaml")


def test_a_written_file_is_read_back_by_rtcf_and_other_readers() -> None:
    (graph,) = rtcf.read_graphs(FULL, "x")
    parameters = ["a:='1e3'", "b:='yes'", "c:=''", "d:='0o7'", "e:='a: b'", "f:=1e20", "g:=.nan"]
    graph.components[0].parameters.extend(rtcf.parse_parameter(text) for text in parameters)
    text = rtcf.write_graphs([graph])
    (again,) = rtcf.read_graphs(text, "y")
    assert again.runner == graph.runner
    assert again.settings == graph.settings
    assert str(again.components[0]) == str(graph.components[0])  # a NaN does not equal itself
    others = yaml.safe_load(text)["components"][0]["parameters"]
    assert (others["a"], others["b"], others["c"], others["d"]) == ("1e3", "yes", "", "0o7")
    two = rtcf.write_graphs([graph, rtcf.Graph("b")])
    assert [each.runner for each in rtcf.read_graphs(two, "z")] == ["arm", "b"]


TEXTS = st.one_of(
    st.text(max_size=40),
    # Texts that YAML reads as another type, or cannot read.
    st.text(alphabet="0123456789+-.:_eExXoOinfNaA~#'\"\\ \n\r\t\x85\u2028", max_size=12),
    st.sampled_from(["9" * 20, "9" * 5000, '"a\\q"', "2001-01-01", "12:30:45", "null", "=", "<<"]),
)


@seed(SEED)
@settings(max_examples=500)
@given(TEXTS)
@example("9" * 20)
@example('"a\\q"')
@example("9" * 5000)
@example("a\x85b")
@example("'a'")
def test_any_text_is_saved_and_read_back(text: str) -> None:
    spec = graph_pb2.ComponentSpec(package="p", type="T", name="x")
    spec.parameters.add(name="k", value=graph_pb2.ParameterValue(string_value=text))
    (graph,) = rtcf.read_graphs(rtcf.write_graphs([rtcf.Graph("arm", components=[spec])]), "x")
    assert list(graph.components) == [spec]


def test_a_live_spec_has_the_present_values() -> None:
    info = graph_pb2.ComponentInfo(
        spec=rtcf.component("p", "T", name="a", parameters=["given:=1"], every=1)
    )
    for name, value, default in (
        ("given", 5.0, 0.0), ("same", 1.0, 1.0), ("other", 2.0, 1.0), ("nan", 1.0, float("nan")),
    ):  # fmt: skip
        info.parameters.add(
            name=name,
            value=graph_pb2.ParameterValue(double_value=value),
            default_value=graph_pb2.ParameterValue(double_value=default),
        )
    spec = rtcf.live_spec(info)
    assert [(each.name, each.value.double_value) for each in spec.parameters] == [
        ("given", 5.0), ("other", 2.0), ("nan", 1.0),
    ]  # fmt: skip
    assert spec.every == 0


def write(folder: Path, text: str) -> str:
    file = folder / "graph.yaml"
    file.write_text(text)
    return str(file)


TWO = (
    "components:\n- {package: demo, type: Fine, name: a}\n- {package: demo, type: Fine, name: b}\n"
)


def test_apply_shows_the_difference_and_changes_once(
    daemon: DaemonUnderTest, client: rtcf.Client, tmp_path: Path
) -> None:
    client.load(rtcf.component("demo", "Fine", name="gone"))
    file = write(tmp_path, "settings: {frequency_hz: 500}\n" + TWO)
    dry = daemon.ctl("apply", file, "--dry-run")
    assert (dry.returncode, dry.stderr) == (0, "")
    for words in (["load", "/a"], ["unload", "/gone"], ["settings", "frequency_hz"]):
        assert any(all(word in line for word in words) for line in dry.stdout.splitlines())
    assert "nothing was changed" in dry.stdout
    assert client.get_order() == ["/gone"]
    assert client.get_status().runners[0].settings.frequency_hz == 1000.0

    unnamed = daemon.ctl("apply", file)
    assert unnamed.returncode == 1
    assert "would unload /gone from runner rt_runner, which it does not name" in unnamed.stderr
    assert client.get_order() == ["/gone"]
    assert daemon.ctl("-r", "rt_runner", "apply", file).stdout.endswith("applied\n")
    assert client.get_order() == ["/a", "/b"]
    assert client.get_status().runners[0].settings.frequency_hz == 500.0
    assert [each["name"] for each in daemon.saved()["components"]] == ["a", "b"]
    assert daemon.ctl("apply", file).stdout == "nothing to change\n"


def test_a_rejected_graph_changes_nothing(
    daemon: DaemonUnderTest, client: rtcf.Client, tmp_path: Path
) -> None:
    client.load(rtcf.component("demo", "Fine", name="kept"))
    text = "settings: {frequency_hz: 500}\ncomponents: [{package: demo, type: Refused}]\n"
    done = daemon.ctl("-r", "rt_runner", "apply", write(tmp_path, text))
    assert (done.returncode, done.stderr) == (1, "rtcfctl: Refused.configure failed\n")
    assert client.get_order() == ["/kept"]
    assert client.get_status().runners[0].settings.frequency_hz == 1000.0


def test_an_invalid_file_is_rejected_with_its_line(daemon: DaemonUnderTest, tmp_path: Path) -> None:
    file = write(tmp_path, "components:\n- {package: demo, typ: Fine}\n")
    done = daemon.ctl("apply", file)
    assert done.returncode == 1
    assert done.stderr.startswith(f'rtcfctl: {file}:2: unknown key "typ" of a component')


def test_a_runner_is_added_with_its_graph_or_not_at_all(
    daemon: DaemonUnderTest, client: rtcf.Client, tmp_path: Path
) -> None:
    good = f"runner: arm\nsettings: {{priority: 70}}\n{TWO}"
    dry = daemon.ctl("apply", write(tmp_path, good), "--dry-run")
    assert "runner arm would be added" in dry.stderr
    assert len(client.get_status().runners) == 1
    assert daemon.ctl("apply", write(tmp_path, good)).returncode == 0
    assert client.get_order("arm") == ["/a", "/b"]
    assert client.get_status("arm").runners[0].settings.priority == 70
    bad = good.replace("arm", "leg").replace("Fine", "Refused")
    assert daemon.ctl("apply", write(tmp_path, bad)).returncode == 1
    assert len(client.get_status().runners) == 2


def test_no_runner_changes_if_one_of_them_is_rejected(
    daemon: DaemonUnderTest, client: rtcf.Client, tmp_path: Path
) -> None:
    client.add_runner("arm")
    text = """\
runners:
  arm: {components: [{package: demo, type: Fine}]}
  rt_runner: {components: [{package: demo, type: Refused}]}
"""
    assert daemon.ctl("apply", write(tmp_path, text)).returncode == 1
    assert client.get_order("arm") == []
    assert daemon.ctl("-r", "arm", "apply", write(tmp_path, text)).returncode == 0
    assert client.get_order("arm") == ["/Fine"]
    wrong = daemon.ctl("-r", "leg", "apply", write(tmp_path, text))
    assert "no runner leg (runners: arm, rt_runner)" in wrong.stderr


def test_apply_reads_files_written_by_save(
    daemon: DaemonUnderTest, client: rtcf.Client, tmp_path: Path
) -> None:
    client.set_runner(runner_pb2.RunnerSettings(frequency_hz=500.0))
    client.load(rtcf.component("demo", "Fine", name="a", ns="/arm", first=True, every=2, phase=1))
    client.load(rtcf.component("demo", "Fine", name="b", remaps=["in1:=/x"]))
    client.set_parameters("b", [rtcf.parse_parameter("kp:=2.5")])
    file = tmp_path / "saved.yaml"
    done = daemon.ctl("save", str(file))
    assert done.stdout == f"saved rt_runner to {file}\n"
    (graph,) = rtcf.read_graphs(file.read_text(), "saved")
    assert graph.runner == "rt_runner"
    assert graph.settings == runner_pb2.RunnerSettings(frequency_hz=500.0)
    assert graph.components == [
        rtcf.component("demo", "Fine", name="a", ns="/arm", first=True, every=2, phase=1),
        rtcf.component("demo", "Fine", name="b", remaps=["in1:=/x"], parameters=["kp:=2.5"]),
    ]
    client.unload(["/arm/a", "b"])
    assert daemon.ctl("apply", str(file)).returncode == 0
    assert client.get_order() == ["/arm/a", "/b"]
    assert daemon.ctl("save").stdout == file.read_text()
    client.add_runner("arm")
    assert list(yaml.safe_load(daemon.ctl("save", "--all").stdout)["runners"]) == [
        "arm",
        "rt_runner",
    ]


def test_save_replaces_no_pipe_and_no_link(daemon: DaemonUnderTest, tmp_path: Path) -> None:
    text = daemon.ctl("save").stdout
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    with subprocess.Popen(["cat", pipe], stdout=subprocess.PIPE, text=True) as reader:
        done = daemon.ctl("save", str(pipe))
        assert (done.returncode, reader.communicate()[0]) == (0, text), done.stderr
    assert pipe.is_fifo()
    file, link = tmp_path / "repository" / "arm.yaml", tmp_path / "arm.yaml"
    file.parent.mkdir()
    link.symlink_to(file)
    done = daemon.ctl("save", str(link))
    assert done.returncode == 1
    assert done.stderr == f"rtcfctl: {link}: a symbolic link that leads nowhere\n"
    file.touch()
    file.chmod(0o664)
    assert daemon.ctl("save", str(link)).returncode == 0
    assert link.is_symlink()
    assert file.read_text() == text
    assert stat.S_IMODE(file.stat().st_mode) == 0o664
    # The kernel's own link, with any target.
    log = tmp_path / "log"
    log.write_text("before\n")
    with log.open("a") as out:
        rtcfctl = str(BUILD_TREE / "bin" / "rtcfctl")
        save = [rtcfctl, "--socket", str(daemon.socket), "save", "/proc/self/fd/1"]
        assert subprocess.run(save, stdout=out).returncode == 0
    assert log.read_text() == f"before\n{text}saved rt_runner to /proc/self/fd/1\n"


@pytest.mark.skipif(os.geteuid() != 0, reason="requires root to create files of another user")
def test_save_trusts_no_foreign_file_in_a_world_writable_folder(
    daemon: DaemonUnderTest, tmp_path: Path
) -> None:
    everybodys = tmp_path / "tmp"
    everybodys.mkdir()
    everybodys.chmod(0o1777)
    file = everybodys / "arm.yaml"
    file.touch()
    file.chmod(0o666)
    os.chown(file, 65534, 65534)
    assert daemon.ctl("save", str(file)).returncode == 0
    found = file.stat()
    assert (found.st_uid, stat.S_IMODE(found.st_mode) & 0o022) == (0, 0)

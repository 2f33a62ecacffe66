"""`rtcfctl apply` and `save` with a running loop."""

import json
import shutil
from pathlib import Path

import pytest
import rtcf
import yaml
from daemon_process import BUILD_TREE, Daemon, wait_for
from rtcf.v1 import runner_pb2
from values import state

GRAPH = """\
settings:
  frequency_hz: 500
components:
  - {name: steady, package: rtcf_test, type: Counter}
  - name: knobs
    ns: /arm
    package: rtcf_test
    type: Knobs
    remaps: {product: /p}
    parameters: {rate: 2.5, label: abcdef, mode: idle}
  - {name: slow, package: rtcf_test, type: Counter, remaps: {in: /out, out: /s}, every: 4, phase: 1}
"""


@pytest.fixture
def file(tmp_path: Path) -> Path:
    file = tmp_path / "graph.yaml"
    file.write_text(GRAPH)
    return file


def changes(daemon: Daemon, *arguments: str) -> set[tuple[str, str]]:
    """Apply; return the kinds and names of the changes."""
    done = daemon.ctl("-r", "rt_runner", "apply", *arguments, "-o", "yaml")
    assert done.returncode == 0, done.stderr
    differences = yaml.safe_load(done.stdout)["rt_runner"]["differences"]
    return {(each["kind"], each["component"]) for each in differences}


def count(client: rtcf.Client, name: str) -> int:
    ports = {port.name: port for port in client.get_component(name).ports}
    return int((ports["out"].value or "0").removeprefix("data: "))


def test_a_second_apply_of_a_file_changes_nothing(
    daemon: Daemon, client: rtcf.Client, file: Path
) -> None:
    client.load(rtcf.component("rtcf_test", "Counter", name="gone"))
    client.start()
    expected = {
        ("unload", "/gone"), ("load", "/steady"), ("load", "/arm/knobs"), ("load", "/slow"),
        ("settings", ""),
    }  # fmt: skip
    assert changes(daemon, str(file), "--dry-run") == expected
    assert client.get_order() == ["/gone"]
    assert changes(daemon, str(file)) == expected
    assert set(client.get_order()) == {"/steady", "/arm/knobs", "/slow"}
    assert client.get_status().runners[0].settings.frequency_hz == 500.0
    assert changes(daemon, str(file)) == set()


def test_unchanged_components_are_not_touched(
    daemon: Daemon, client: rtcf.Client, file: Path
) -> None:
    changes(daemon, str(file))
    client.start()
    wait_for(lambda: count(client, "steady") > 50, "50 cycles")
    before = count(client, "steady")
    file.write_text(
        GRAPH.replace("rate: 2.5", "rate: 1.0").replace(
            "type: Counter, remaps", "type: Counter, first: true, remaps"
        )
    )
    assert changes(daemon, str(file)) == {("parameters", "/arm/knobs"), ("breaks", "/slow")}
    assert count(client, "steady") > before
    (rate,) = [
        each.value.double_value
        for each in client.get_component("/arm/knobs").parameters
        if each.name == "rate"
    ]
    assert rate == 1.0


def test_another_fixed_parameter_replaces_the_component(
    daemon: Daemon, client: rtcf.Client, file: Path
) -> None:
    arm = "runner: rt_runner\ncomponents:\n- {{package: rtcf_control, type: {}, name: {}, {}}}\n"
    client.start()
    for joints, initial in (("a b", "0 0"), ("a b c", "0 0 0"), ("c b", "0 0")):
        given = f"parameters: {{joints: '{joints}', initial: '{initial}'}}"
        file.write_text(arm.format("TrajectoryGenerator", "arm", given))
        changed = changes(daemon, str(file))
        assert changed == {("load" if joints == "a b" else "replace", "/arm")}
        assert changes(daemon, str(file)) == set()
        (found,) = (
            each for each in client.get_component("arm").parameters if each.name == "joints"
        )
        assert (found.value.string_value, found.fixed) == (joints, True)
    assert state(client).state == runner_pb2.RUNNER_STATE_RUNNING
    assert "fixed" in daemon.ctl("info", "arm").stdout
    done = daemon.ctl("set", "arm", "joints:=d e")
    assert done.returncode == 1
    assert "/arm: parameter joints is fixed at the load: `rtcfctl replace` with" in done.stderr


LOOP = """\
    - {package: rtcf_examples, type: Identity, name: i1, remaps: {in: /x, out: /y}}
    - {package: rtcf_examples, type: Identity, name: i2, remaps: {in: /y, out: /x}}
"""


@pytest.mark.parametrize(
    ("components", "said"),
    [
        (LOOP, "let one input read the previous cycle: `breaks: [in]` of i"),
        ("    - {package: rtcf_test, type: Counter, name: 2nd}\n", "2nd"),
        ("    - {package: rtcf_test, type: Counter, remaps: {out: a b}}\n", "a b"),
        ("    - {package: rtcf_test, type: Knobs, parameters: {rate: fast}}\n", "rate"),
        (2 * "    - {package: rtcf_test, type: Counter, name: twice}\n", "twice"),
    ],
    ids=["loop", "name", "remap", "parameter", "twice"],
)
def test_several_graphs_of_which_one_is_wrong_change_nothing(
    daemon: Daemon, client: rtcf.Client, file: Path, components: str, said: str
) -> None:
    first = "  aa:\n    components:\n    - {package: rtcf_test, type: Counter, name: a}\n"
    file.write_text(f"runners:\n{first}  bb:\n    components:\n{components}")
    for arguments in (("--dry-run",), ()):
        done = daemon.ctl("apply", str(file), *arguments)
        assert done.returncode != 0
        assert said in done.stderr
        assert [each.runner for each in client.get_status().runners] == ["rt_runner"]
    assert not client.get_order()


def test_a_rejected_file_changes_nothing(daemon: Daemon, client: rtcf.Client, file: Path) -> None:
    changes(daemon, str(file))
    order = client.get_order()
    file.write_text(
        GRAPH.replace("500", "800") + "  - {package: rtcf_test, type: FailingConfigure}\n"
    )
    done = daemon.ctl("apply", str(file))
    assert done.returncode == 1
    assert "/dev/gripper does not answer" in done.stderr
    assert client.get_order() == order
    assert client.get_status().runners[0].settings.frequency_hz == 500.0


def test_save_and_apply_are_inverse(daemon: Daemon, client: rtcf.Client, file: Path) -> None:
    changes(daemon, str(file))
    client.set_parameters("/arm/knobs", [rtcf.parse_parameter("count:=5")])
    client.set_breaks([rtcf.parse_port("slow.in")], True)
    saved = file.with_name("saved.yaml")
    assert daemon.ctl("save", str(saved)).returncode == 0
    assert changes(daemon, str(saved)) == set()
    client.unload(["steady", "/arm/knobs", "slow"])
    changes(daemon, str(saved))
    assert daemon.ctl("save").stdout == saved.read_text()
    # JSON is a graph file, too.
    in_json = daemon.ctl("-o", "json", "save").stdout
    assert json.loads(in_json) == yaml.safe_load(saved.read_text())
    saved.write_text(in_json)
    assert changes(daemon, str(saved)) == set()
    saved.write_text(daemon.ctl("save").stdout)
    (graph,) = rtcf.read_graphs(saved.read_text(), "saved")
    (knobs,) = [each for each in graph.components if each.name == "knobs"]
    values = {each.name: each.value for each in knobs.parameters}
    assert values["count"].int_value == 5
    assert values["mode"].string_value == "idle"


def test_the_graph_of_a_file_is_restored_after_a_crash(
    daemon: Daemon, client: rtcf.Client, file: Path
) -> None:
    changes(daemon, str(file))
    order = client.get_order()
    daemon.end()
    daemon.start()
    with rtcf.Client(daemon.socket) as again:
        assert again.get_order() == order
        assert again.get_component("slow").spec.every == 4
    assert changes(daemon, str(file)) == set()


def test_components_are_constructed_in_the_order_of_execution(
    client: rtcf.Client,
) -> None:
    components = [
        rtcf.component("rtcf_test", "Weights", name="a", remaps=["u:=mid"]),
        rtcf.component("rtcf_test", "Polynomial", name="b", remaps=["y:=mid"]),
        rtcf.component("rtcf_examples", "Wave", name="c", remaps=["out:=/b/start"]),
    ]
    lines: list[str] = []
    client.apply(components, "rt_runner", on_progress=lines.append)
    order = [line.split()[1] for line in lines if line.startswith("configuring")]
    assert order == client.get_order() == ["/b", "/a", "/c"]


def test_apply_loads_a_rebuilt_library_if_requested(tmp_path: Path) -> None:
    built = BUILD_TREE / "lib" / "rtcf" / "rtcf_examples" / "rtcf_examples.so"
    library = tmp_path / "packages" / "rtcf_mine" / "mine.so"
    library.parent.mkdir(parents=True)
    shutil.copy(built, library)
    daemon = Daemon(tmp_path, arguments=["--path", str(tmp_path / "packages")])
    daemon.start()
    try:
        graph = tmp_path / "graph.yaml"
        graph.write_text(
            "components:\n"
            "  - {package: rtcf_mine, type: Mimo}\n"
            "  - {package: rtcf_examples, type: Identity}\n"
        )
        assert daemon.ctl("apply", str(graph)).returncode == 0
        assert daemon.ctl("start").returncode == 0
        shutil.copy(built, library.with_suffix(".new"))
        library.with_suffix(".new").rename(library)
        assert "library changed" in daemon.ctl("list").stdout
        assert daemon.ctl("apply", str(graph)).stdout == "nothing to change\n"
        done = daemon.ctl("apply", str(graph), "--rebuilt", "-o", "json")
        (difference,) = json.loads(done.stdout)["rt_runner"]["differences"]
        assert (difference["component"], difference["detail"]) == (
            "/Mimo", "its library has changed",
        )  # fmt: skip
        assert "library changed" not in daemon.ctl("list").stdout
        assert daemon.ctl("apply", str(graph), "--rebuilt").stdout == "nothing to change\n"
    finally:
        daemon.end()

"""Compiled Python components in a real loop: values, state, logs and faults."""

import re
import subprocess
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
import rtcf
from daemon_process import BUILD_TREE, Daemon, clean_environment, wait_for
from geometry_msgs.msg import TwistStamped
from pages import TREE
from rtcf.v1 import graph_pb2, runner_pb2
from rtcf_compile.source.modules import components, load
from sensor_msgs.msg import JointState
from values import state

SOURCE = TREE / "tests" / "components" / "python" / "controllers.py"
MESSAGES = SOURCE.with_name("messages.py")
RTCF_DIR = BUILD_TREE / "cmake" / "rtcf"
PROJECT = """\
cmake_minimum_required(VERSION 3.25)
project(controllers LANGUAGES CXX)
find_package(rtcf REQUIRED)
rtcf_add_python_components(controllers PACKAGE py SOURCES {source} {messages})
"""
COMPILE_DEADLINE_S = 900.0


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Build the components once, as a user's project does; return the folder of packages."""
    project = tmp_path_factory.mktemp("project")
    (project / "CMakeLists.txt").write_text(PROJECT.format(source=SOURCE, messages=MESSAGES))
    for arguments in (["-S", ".", "-B", "build", f"-Drtcf_DIR={RTCF_DIR}"], ["--build", "build"]):
        done = subprocess.run(
            ["cmake", *arguments],
            cwd=project,
            env=clean_environment(),
            capture_output=True,
            text=True,
            timeout=COMPILE_DEADLINE_S,
            check=False,
        )
        assert done.returncode == 0, done.stdout + done.stderr
    return project / "build" / "lib" / "rtcf"


@pytest.fixture
def daemon(tmp_path: Path, folder: Path) -> Iterator[Daemon]:
    """Yield an rtcfd that finds the components."""
    daemon = Daemon(tmp_path, arguments=("--path", str(folder)))
    daemon.start()
    yield daemon
    if not daemon.ended:
        daemon.end()


def _load_both(client: rtcf.Client) -> None:
    client.load(rtcf.component("py", "Ramp", name="ramp", parameters=["step:=3"]))
    client.load(rtcf.component("py", "Observer", name="observer"))


def _states(client: rtcf.Client, name: str) -> dict[str, str]:
    return {each.name: each.value for each in client.get_component(name).states}


def _ports(client: rtcf.Client, name: str) -> dict[str, graph_pb2.PortInfo]:
    return {each.name: each for each in client.get_component(name).ports}


def test_the_loop_computes_the_same_as_the_source(daemon: Daemon, client: rtcf.Client) -> None:
    _load_both(client)
    assert client.get_order() == ["/ramp", "/observer"]
    client.step(250)
    assert _states(client, "ramp")["total"] == "750"
    assert float(_states(client, "ramp")["passed"]) == pytest.approx(0.25)
    assert _states(client, "observer")["seen"] == "250"
    assert _states(client, "observer")["mode"] == "1"
    estimate = x = 0.0
    for cycle in range(1, 251):
        error = cycle * 0.001 - x
        x, estimate = (
            x + 0.001 * estimate + 0.001 * 0.4 * error,
            0.98 * estimate + 0.02 * 0.5 + 0.001 * 12.0 * error,
        )
    shown = re.findall(r"[-\d.e]+", _states(client, "observer")["estimate"])
    assert [float(each) for each in shown] == pytest.approx([x, estimate], rel=1e-5)


def test_an_input_keeps_its_value_between_writers(client: rtcf.Client, daemon: Daemon) -> None:
    def seen(cycles: int) -> list[str]:
        client.step(cycles)
        states = _states(client, "watcher")
        return [states[each] for each in ("last", "fresh", "valid", "age", "connected")]

    client.load(rtcf.component("py", "Watcher", name="watcher"))
    assert seen(2) == ["0", "0", "0", "-1", "0"]
    client.load(rtcf.component("py", "Seldom", name="writer"))
    assert seen(5) == ["5", "5", "1", "0", "1"]
    client.unload(["writer"])
    assert seen(3) == ["5", "5", "1", "3000000", "0"]
    client.load(rtcf.component("py", "Seldom", name="next", parameters=["every:=4"]))
    assert seen(3) == ["5", "5", "1", "6000000", "1"]
    assert seen(1) == ["4", "6", "1", "0", "1"]
    assert seen(2) == ["4", "6", "1", "2000000", "1"]


def test_a_fixed_parameter_is_set_at_the_load_only(client: rtcf.Client, daemon: Daemon) -> None:
    client.load(rtcf.component("py", "Seldom", name="writer", parameters=["every:=4"]))
    (every,) = (each for each in client.get_component("writer").parameters if each.fixed)
    assert (every.name, every.value.int_value) == ("every", 4)
    with pytest.raises(rtcf.RefusedError, match="every is fixed at the load: `rtcfctl replace`"):
        client.set_parameters("writer", [rtcf.parse_parameter("every:=3")])
    client.set_parameters("writer", [rtcf.parse_parameter("every:=4")])


def test_a_queue_holds_messages_of_cycles_that_its_reader_skips(
    client: rtcf.Client, daemon: Daemon
) -> None:
    client.load(rtcf.component("py", "Ramp", name="ramp"))
    client.load(rtcf.component("py", "Gatherer", name="gatherer", every=4))
    client.step(40)
    states = _states(client, "gatherer")
    messages = int(states["messages"])
    assert 37 <= messages <= 40  # the last ones may wait for the reader's next cycle
    assert (states["last"], states["in_order"]) == (str(messages), "1")
    seconds = sum(each * 0.001 for each in range(1, messages + 1))
    assert float(states["seconds"]) == pytest.approx(seconds)
    assert states["oldest"] == "3000000"


def test_messages_are_as_in_cpp_components(client: rtcf.Client, daemon: Daemon) -> None:
    client.load(rtcf.component("py", "Joints", name="joints"))
    client.load(rtcf.component("py", "Arm", name="arm"))
    client.step(20)
    model: Any = next(each for each in components(load(MESSAGES)) if each.__name__ == "Arm")()
    wanted = TwistStamped()
    wanted.twist.linear.x, wanted.twist.linear.y = 0.1, -0.2
    for cycle in range(1, 21):
        message = JointState(position=[0.01 * cycle * joint for joint in (1, 2, 3)])
        model.joints.put(message)
        model.wanted.put(wanted)
        model.cycle()
    shown = re.findall(r"[-\d.e]+", _states(client, "arm")["filtered"])
    assert abs(model.filtered[0]) > 0.01
    assert [float(each) for each in shown] == pytest.approx(list(model.filtered), rel=1e-4)
    assert _states(client, "arm")["incomplete"] == "0"
    ports = _ports(client, "arm")
    assert ports["command"].type == "sensor_msgs/JointState"
    command = ports["command"].value
    for text in ("seq: 20 ", "frame_id: base ", "name[1]: elbow ", "velocity[2]: "):
        assert text in command
    assert command.endswith("effort[]")
    assert f" x: {model.tip.value.pose.position.x:.5f}" in ports["tip"].value
    joints = _ports(client, "joints")["joints"].value
    assert "position[1]: 0.4 " in joints and "stamp: 0.018999995 " in joints


def test_a_message_longer_than_declared_is_rejected(client: rtcf.Client, daemon: Daemon) -> None:
    client.load(rtcf.component("py", "Crowd", name="crowd"))
    client.load(rtcf.component("py", "Arm", name="arm"))
    client.step(5)
    assert _states(client, "arm")["incomplete"] == "5"
    said = "a message of joints has more elements than declared and is ignored"
    wait_for(lambda: said in daemon.log(), "the warning")


def test_derived_values_follow_their_parameters(client: rtcf.Client, daemon: Daemon) -> None:
    client.load(rtcf.component("py", "Ramp", name="ramp"))
    parameters = ["length:=0.2", "gains_1:=3.0"]
    spec = rtcf.component(
        "py", "Pendulum", name="p", parameters=parameters, remaps=["angle:=seconds"]
    )
    client.load(spec)
    pendulum: Any = next(each for each in components(load(SOURCE)) if each.__name__ == "Pendulum")
    model = pendulum(length=0.2, gains=[20.0, 3.0])
    seconds = 0.0

    def agrees_after(cycles: int) -> None:
        nonlocal seconds
        client.step(cycles)
        for _ in range(cycles):
            seconds += 0.001
            model.angle.put(seconds)
            model.cycle()
        shown = re.findall(r"[-\d.e]+", _states(client, "p")["x"])
        assert [float(each) for each in shown] == pytest.approx(list(model.x), rel=1e-4)

    agrees_after(50)
    assert daemon.ctl("set", "p", "length:=1.5", "gains_0:=7").returncode == 0
    longer = pendulum(length=1.5, gains=[7.0, 3.0])
    longer.x[:] = model.x
    model = longer
    agrees_after(50)
    refused = daemon.ctl("set", "p", "gains_0:=99.5")
    assert refused.returncode == 1
    assert re.search(r"controllers\.py:\d+: .*: ValueError: stiffer than the drive", refused.stderr)
    agrees_after(50)


def test_declarations_are_as_in_cpp_components(client: rtcf.Client, daemon: Daemon) -> None:
    _load_both(client)
    ramp = client.get_component("ramp")
    assert ramp.doc == "Counts cycles, in all types of a port"
    (step,) = ramp.parameters
    assert (step.minimum, step.maximum, step.doc) == (1.0, 1000.0, "by which it counts")
    assert {each.name: each.unit for each in ramp.states} == {"total": "", "passed": "s"}
    types = {name: port.type for name, port in _ports(client, "ramp").items()}
    assert types == {
        "count": "int64",
        "seconds": "double",
        "even": "bool",
        "pair": "Eigen::Matrix<double,2,1>",
    }
    refused = daemon.ctl("set", "ramp", "step:=0")
    assert refused.returncode == 1 and "step" in refused.stderr


def test_ports_have_units_and_meanings(daemon: Daemon, client: rtcf.Client) -> None:
    told = {
        "u": ("m/s", "measured speed"),
        "goals": ("m", "positions to reach"),
        "integral": ("m", "position"),
    }
    types = {each.type: each for each in client.list_types("py").types}
    of_type = types["Integrator"].ports
    assert {each.name: (each.unit, each.doc) for each in of_type} == told
    client.load(rtcf.component("py", "Integrator", name="integrator"))
    loaded = _ports(client, "integrator")
    assert {name: (each.unit, each.doc) for name, each in loaded.items()} == told
    for words in (("--type", "py/Integrator"), ("integrator",)):
        shown = daemon.ctl("info", *words).stdout
        assert re.search(r"^u +in .* m/s .*measured speed$", shown, re.M), shown


def test_an_array_of_bools_is_set_by_its_elements(daemon: Daemon, client: rtcf.Client) -> None:
    client.load(rtcf.component("py", "Axes", name="axes", parameters=["enabled_1:=true"]))
    types = {each.name: each.type for each in client.get_component("axes").parameters}
    names = [f"enabled_{i}" for i in range(3)]
    names += [f"plan/way_{i}_{j}" for i in range(2) for j in range(2)]
    assert types == dict.fromkeys(names, "bool")
    client.step(2)
    assert _states(client, "axes")["total"] == "[8; 0; 8]"
    assert daemon.ctl("set", "axes", "enabled_0:=false", "plan/way_0_1:=true").returncode == 0
    client.step(1)
    assert _states(client, "axes")["total"] == "[9; 4; 12]"
    refused = daemon.ctl("set", "axes", "enabled_0:=2")
    assert refused.returncode == 1 and "enabled_0" in refused.stderr
    others = [f"{name}:=false" for name in names]
    refused = daemon.ctl("set", "axes", *others)
    assert refused.returncode == 1 and "no axis" in refused.stderr


def test_a_state_has_three_dimensions(tmp_path: Path, daemon: Daemon, client: rtcf.Client) -> None:
    client.load(rtcf.component("py", "Window", name="window"))
    found = {each.name: each for each in client.get_component("window").states}
    types = {name: (each.type, each.unit) for name, each in found.items()}
    assert types == {"samples": ("double[3x2x2]", "m"), "counts": ("int16[3x2x2]", "")}
    half = "[0.5, 0.5; 0.5, 0.5]"
    assert found["samples"].initial == f"[{half}, {half}, {half}]"
    assert daemon.ctl("write", "window.u", "[[1, 2], [3, 4]]").returncode == 0
    with client.watch_ports(["/window.*"]) as stream:
        client.step(2)
        batch = next(iter(stream))
        samples = batch["/window.samples"]
    assert samples.shape[1:] == (3, 2, 2)
    assert samples[-1].tolist() == [[[1.0, 2.0], [3.0, 4.0]]] * 2 + [[[0.5, 0.5], [0.5, 0.5]]]
    after = _states(client, "window")
    assert after["counts"] == "[[0, 0; 2, 0], [0, 0; 2, 0], [0, 0; 2, 0]]"
    snapshot = str(tmp_path / "snapshot")
    assert daemon.ctl("snapshot", snapshot).returncode == 0
    client.step(3)
    assert _states(client, "window") != after
    assert daemon.ctl("restore", snapshot).returncode == 0
    assert _states(client, "window") == after
    client.replace("window", rtcf.component("py", "Window", name="window"))
    assert _states(client, "window") == after
    assert daemon.ctl("reset", "window").returncode == 0
    assert _states(client, "window")["samples"] == found["samples"].initial


def test_private_states_lose_their_underscore_outside(
    tmp_path: Path, daemon: Daemon, client: rtcf.Client
) -> None:
    client.load(rtcf.component("py", "Integrator", name="integrator"))
    names = ["integral", "last", "last__known", "latched", "sums", "time", "record", "memory"]
    assert list(_states(client, "integrator")) == names
    assert daemon.ctl("write", "integrator.u", "3.0").returncode == 0
    client.step(4)
    assert float(_states(client, "integrator")["integral"]) == pytest.approx(0.512)
    snapshot = str(tmp_path / "snapshot")
    assert daemon.ctl("snapshot", snapshot).returncode == 0
    before = _states(client, "integrator")
    done = daemon.ctl("set", "integrator.state", "integral:=2000.0")
    assert done.returncode == 0, done.stderr
    client.step(1)
    states = _states(client, "integrator")
    assert float(states["integral"]) > 2000.0 and states["latched"] == "1"
    assert daemon.ctl("get", "integrator.state.integral").stdout.startswith("2000.")
    assert daemon.ctl("restore", snapshot).returncode == 0
    assert _states(client, "integrator") == before
    assert daemon.ctl("reset", "integrator").returncode == 0
    assert _states(client, "integrator")["integral"] == "0.5"
    with client.watch_ports(["/integrator.integral*"]) as stream:
        client.step(1)
        signals = set(next(iter(stream)).schema.signals)
    assert signals == {"/integrator.integral", "/integrator.integral[state]"}


def test_a_parameter_change_takes_effect_in_the_next_cycle(
    client: rtcf.Client, daemon: Daemon
) -> None:
    _load_both(client)
    client.step(10)
    assert daemon.ctl("set", "ramp", "step:=10").returncode == 0
    client.step(10)
    assert _states(client, "ramp")["total"] == "130"


def test_state_is_kept_by_a_replacement_and_restored_by_reset(
    client: rtcf.Client, daemon: Daemon
) -> None:
    _load_both(client)
    client.step(100)
    assert not client.replace("ramp", rtcf.component("py", "Ramp", name="ramp")).notes
    assert _states(client, "ramp")["total"] == "300"
    client.step(1)
    assert _states(client, "ramp")["total"] == "303"
    assert daemon.ctl("reset", "ramp").returncode == 0
    assert _states(client, "ramp")["total"] == "0"


def test_log_records_contain_their_arguments(client: rtcf.Client, daemon: Daemon) -> None:
    _load_both(client)
    client.step(5)
    wait_for(lambda: "third value 0.003 after 3 ms" in daemon.log(), "the record")


def test_safe_runs_in_the_last_cycle(client: rtcf.Client, daemon: Daemon) -> None:
    _load_both(client)
    client.start()
    wait_for(lambda: state(client).iteration > 20, "20 cycles")
    client.stop()
    assert _ports(client, "ramp")["count"].value == "data: 0"


WAYS = {
    1: r"`raise ValueError\(\"the limit is passed\"\)`: ValueError: the limit is passed",
    2: r"`self\.few\[self\.place\] = 1\.0`: IndexError: index 5 is out of bounds for size 3",
    3: r"`self\.zero = quotient\(1\.0, self\.zero\)`: ZeroDivisionError: division by zero",
    4: r"`self\.fault\(\"no reply from the drive\"\)`: no reply from the drive",
    5: r"`self\.few\[:\] = np\.ones\(self\.place\)`: ValueError: .* size 3 is set to one of size 5",
    6: r"`self\.few\[0\] = .*`: MemoryError: the temporary arrays do not fit into the arena",
    7: r"`self\.place = .*`: ZeroDivisionError: ",
}


@pytest.mark.parametrize("way", WAYS)
def test_a_fault_names_file_line_and_text(client: rtcf.Client, daemon: Daemon, way: int) -> None:
    client.load(
        rtcf.component("py", "Failing", name="bad", parameters=[f"way:={way}", "after:=20"])
    )
    client.start()
    wait_for(lambda: state(client).state == runner_pb2.RUNNER_STATE_FAULTED, "the fault")
    fault = client.get_component("bad").fault
    found = re.search(rf"controllers\.py:(\d+): {WAYS[way]}", fault)
    assert found, fault
    line = SOURCE.read_text().splitlines()[int(found[1]) - 1].strip()
    assert f"`{line}`" in fault
    told = f"controllers.py:{found[1]}"
    wait_for(lambda: told in daemon.log(), "the log")
    assert "666" not in _ports(client, "bad")["out"].value


def test_an_exception_in_start_fails_the_start(client: rtcf.Client, daemon: Daemon) -> None:
    client.load(rtcf.component("py", "Failing", name="bad", parameters=["way:=9"]))
    with pytest.raises(rtcf.RefusedError, match=r"controllers\.py:\d+: .*does not want to start"):
        client.start()


@pytest.mark.parametrize("component", ["Observer", "Gatherer", "Joints"])
def test_a_check_finds_no_undeclared_state(folder: Path, component: str) -> None:
    executor = BUILD_TREE / "bin" / "rtcf-executor"
    library = folder / "py" / "controllers.so"
    options = ["--package", "py", "--type", component, "--cycles", "500"]
    done = subprocess.run(
        [str(executor), "--check", str(library), *options],
        env=clean_environment(),
        capture_output=True,
        text=True,
        timeout=COMPILE_DEADLINE_S,
        check=False,
    )
    assert done.returncode == 0 and "undeclared" not in done.stderr, done.stderr


def test_the_loop_contains_no_python(client: rtcf.Client, daemon: Daemon) -> None:
    _load_both(client)
    client.start()
    wait_for(lambda: state(client).iteration > 20, "20 cycles")
    maps = Path(f"/proc/{state(client).pid}/maps").read_text()
    assert "controllers.so" in maps
    assert not re.search(r"libpython|numba|llvmlite|libLLVM", maps)

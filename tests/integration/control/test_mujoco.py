"""rtcf_mujoco/Simulation against MuJoCo in a C program: the same motion, bit by bit."""

from __future__ import annotations

import math
import subprocess
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import rtcf
from block_bench import PATH, rejection
from daemon_process import BUILD_TREE, Daemon
from hypothesis import given, settings
from hypothesis import strategies as st
from pages import TREE
from rtcf.testing import Bench
from values import iteration, wait_until_after

MODELS = TREE / "tests" / "mujoco" / "models"
ARM = MODELS / "arm.xml"
JOINTS = [f"j{i}" for i in range(1, 7)]
MOTORS = [f"m{i}" for i in range(1, 7)]
REFERENCE = BUILD_TREE / "tests" / "mujoco" / "rtcf_step_model"

Array = Any


def arm(**parameters: Any) -> Bench:
    """Return a bench of the arm at 1 kHz."""
    return Bench("rtcf_mujoco/Simulation", path=PATH, model=str(ARM), **parameters)


def load(client: rtcf.Client) -> None:
    """Load the arm as /sim."""
    spec = rtcf.component("rtcf_mujoco", "Simulation", name="sim", parameters=[f"model:={ARM}"])
    client.load(spec)


def commands(seed: int, cycles: int, largest: float = 20.0) -> Array:
    """Return torques that jump every 100 cycles, of shape (cycles, 6)."""
    draw = np.random.default_rng(seed)
    return np.repeat(draw.uniform(-largest, largest, (cycles // 100 + 1, 6)), 100, axis=0)[:cycles]


def reference(torques: Array, *, key: int = -1, period_s: float = 1e-3, steps: int = 1) -> Array:
    """Return time, positions and velocities from the C program, a row for each cycle."""
    done = subprocess.run(
        [REFERENCE, ARM, str(key), repr(period_s), str(steps)],
        input=np.ascontiguousarray(torques).tobytes(),
        stdout=subprocess.PIPE,
        check=True,
        timeout=300,
    )
    return np.frombuffer(done.stdout).reshape(len(torques), 13)


def motion(bench: Bench, torques: Array) -> Array:
    """Return time, positions and velocities from the component, a row for each cycle."""
    response = bench.run(dict(zip(MOTORS, torques.T, strict=True)))
    ports = [
        "time",
        *(f"{each}_position" for each in JOINTS),
        *(f"{each}_velocity" for each in JOINTS),
    ]
    return np.column_stack([response[each] for each in ports])


def test_the_arm_moves_like_in_a_c_program_bit_by_bit() -> None:
    torques = commands(1, 20_000)
    torques[10_000:14_000, 1] = -40.0
    with arm() as bench:
        response = bench.run(dict(zip(MOTORS, torques.T, strict=True)))
        assert response["contacts"].max() > 0, "the arm hits the plane"
        expected = reference(torques)
        moved = motion(bench, torques)
    assert moved.tobytes() == expected.tobytes()
    assert np.abs(expected[:, 2]).max() > 1.99, "a joint reaches its limit"


@settings(max_examples=8)
@given(
    seed=st.integers(0, 2**32 - 1),
    frequency=st.sampled_from([250.0, 500.0, 800.0, 1000.0, 2000.0]),
    timestep=st.sampled_from([0.0, 0.0005, 0.002]),
    key=st.sampled_from(["", "raised"]),
)
def test_a_cycle_has_as_many_steps_as_its_period_takes(
    seed: int, frequency: float, timestep: float, key: str
) -> None:
    torques = commands(seed, 600)
    period_s = 1e-9 * round(1e9 / frequency)
    steps = max(1, math.ceil(period_s / (timestep or 0.001) * (1 - 1e-9)))
    with arm(frequency_hz=frequency, timestep=timestep, keyframe=key) as bench:
        moved = motion(bench, torques)
    expected = reference(torques, key=0 if key else -1, period_s=period_s, steps=steps)
    assert moved.tobytes() == expected.tobytes()


def test_a_snapshot_continues_the_same_motion(daemon: Daemon, client: rtcf.Client) -> None:
    load(client)
    torques = commands(3, 1)[0]
    for motor, torque in zip(MOTORS, torques, strict=True):
        assert daemon.ctl("write", f"sim.{motor}", repr(float(torque))).returncode == 0

    def state() -> dict[str, str]:
        return {each.name: each.value for each in client.get_component("/sim").states}

    client.step(1500)
    file = daemon.folder / "moving.snapshot"
    assert daemon.ctl("snapshot", str(file)).returncode == 0
    client.step(1500)
    expected = state()
    assert daemon.ctl("restore", str(file)).returncode == 0
    client.step(1500)
    assert state() == expected


def test_a_reset_returns_to_the_keyframe() -> None:
    reset = np.zeros(400, dtype=bool)
    reset[200:] = True
    with arm(keyframe="raised") as bench:
        response = bench.run({"reset": reset, "m1": 5.0})
        positions = np.column_stack([response[f"{each}_position"] for each in JOINTS])
    # From the reset on, everything happens again; only a rising edge resets.
    assert positions[200:].tobytes() == positions[:200].tobytes()
    assert np.allclose(positions[0], [0.1, -0.6, 1.1, 0, 0.3, 0], atol=1e-3)


def test_encoder_positions_are_multiples_of_the_resolution() -> None:
    torques = commands(5, 500)
    with arm() as exact, arm(encoder_counts=4096) as coarse:
        expected, found = motion(exact, torques), motion(coarse, torques)
    counts = found[:, 1:7] / (2 * math.pi) * 4096
    assert np.abs(counts - np.rint(counts)).max() < 1e-9
    assert np.abs(found[:, 1:7] - expected[:, 1:7]).max() <= math.pi / 4096 * (1 + 1e-9)
    assert found[:, 7:].tobytes() == expected[:, 7:].tobytes()


def test_a_push_moves_the_body_that_was_named() -> None:
    push = np.zeros((300, 6))
    push[:, 1] = 10.0  # N, along y: it turns the first joint
    with arm(pushed_body="hand") as bench:
        pushed = bench.run({"push": push})["j1_position"]
        rest = bench.run(steps=300)["j1_position"]
    assert pushed[-1] > rest[-1] + 0.01


def test_brakes_hold_the_arm_against_gravity() -> None:
    braked = np.zeros(1500, dtype=bool)
    braked[200:1000] = True
    with arm(keyframe="raised", brake_friction=200.0) as bench:
        response = bench.run({"brake": braked})
    velocity = np.column_stack([response[f"{each}_velocity"] for each in JOINTS])
    assert np.abs(velocity[199]).max() > 0.1, "it falls"
    assert np.abs(velocity[400:1000]).max() < 1e-2
    assert np.abs(velocity[1300:]).max() > 0.1, "it falls again"


def test_joint_states_have_the_values_of_the_ports() -> None:
    torques = commands(6, 50)
    with arm() as bench:
        response = bench.run(dict(zip(MOTORS, torques.T, strict=True)))
    for i, joint in enumerate(JOINTS):
        for kind in ("position", "velocity", "effort"):
            column = np.array([row[i] for row in response[f"joint_states.{kind}"]])
            assert column.tobytes() == response[f"{joint}_{kind}"].tobytes()


def test_joint_states_have_the_names_of_the_joints(daemon: Daemon, client: rtcf.Client) -> None:
    load(client)
    client.step(1)
    done = daemon.ctl("get", "sim.joint_states")
    assert all(joint in done.stdout for joint in JOINTS), done.stdout + done.stderr


def test_every_kind_of_joint_tendon_and_sensor_has_a_port() -> None:
    with Bench("rtcf_mujoco/Simulation", path=PATH, model=str(MODELS / "everything.xml")) as bench:
        (component,) = bench.client.list_components()
        ports = {each.name: each.type for each in component.ports}
        response = bench.run({"actuator_1": 1.0, "slow": np.full(200, 0.5)})
        states = set(bench.state)
    assert ports == {
        "actuator_1": "double", "slow": "double", "push": "Eigen::Matrix<double,6,1>",
        "reset": "bool", "brake": "bool",
        "joint_states": "sensor_msgs/JointState", "time": "double", "contacts": "int32",
        "cube_pose": "Eigen::Isometry3d", "cube_velocity": "Eigen::Vector3d",
        "cube_rate": "Eigen::Vector3d", "rail_x_position": "double", "rail_x_velocity": "double",
        "rail_x_effort": "double", "hook_orientation": "Eigen::Quaterniond",
        "hook_rate": "Eigen::Vector3d", "joint_4_position": "double", "joint_4_velocity": "double",
        "joint_4_effort": "double", "belt_length": "double", "belt_velocity": "double",
        "acceleration": "Eigen::Vector3d", "attitude": "Eigen::Quaterniond", "force": "double",
        "sensor_4": "double",
    }  # fmt: skip
    assert {"clock", "activation1", "q_cube7", "v_hook3", "a_rail_x", "was_reset"} <= states
    # 0.2 s of free fall.
    assert response["cube_pose.position.z"][-1] == pytest.approx(1 - 9.81 * 0.2**2 / 2, abs=2e-2)
    assert response["belt_length"][-1] == pytest.approx(
        2 * response["rail_x_position"][-1], rel=0.05
    )
    assert 0.0 < response["force"][-1] < 0.5, "the actuator follows its command slowly"


@pytest.mark.parametrize(
    ("parameters", "said"),
    [
        ({"model": ""}, "parameter model is missing: the path of an MJCF file"),
        ({"model": "arm.xml"}, "parameter model = arm.xml is no absolute path"),
        ({"model": "/nowhere/arm.xml"}, "model /nowhere/arm.xml: "),
        ({"model": "{broken}"}, "Schema violation"),
        ({"keyframe": "lowered"}, "parameter keyframe = lowered: "),
        ({"pushed_body": "foot"}, "parameter pushed_body = foot: "),
        (
            {"model": "{user}"},
            "sensor wide has 5 values: only those with 1, 3 or 4 have a port type",
        ),
        ({"model": "{twice}"}, "port 'a_b' is declared twice"),
        ({"model": "{nan}"}, "XML contains a 'NaN'"),
        ({"model": "{negative}"}, "mass, inertia or density are negative"),
        ({"model": "{unreadable}"}, "problem reading attribute 'mass'"),
    ],
)
def test_unsuitable_models_are_rejected_with_one_line(
    tmp_path: Path, parameters: dict[str, Any], said: str
) -> None:
    user = "needstage='acc' datatype='real' objtype='body' objname='world'"
    joint = "<body><joint name='j'/><geom size='1'/></body>"
    motors = "<motor name='a/b' joint='j'/><motor name='a b' joint='j'/>"
    texts = {
        "broken": "<mujoco><worldbody><bogus/></worldbody></mujoco>",
        "user": f"<mujoco><worldbody/><sensor><user name='wide' dim='5' {user}/></sensor></mujoco>",
        "twice": f"<mujoco><worldbody>{joint}</worldbody><actuator>{motors}</actuator></mujoco>",
    }
    for name, mass in (("nan", "nan"), ("negative", "-1"), ("unreadable", "abc")):
        body = joint.replace("<geom", f"<geom mass='{mass}'")
        texts[name] = f"<mujoco><worldbody>{body}</worldbody></mujoco>"
    for name, text in texts.items():
        (tmp_path / f"{name}.xml").write_text(text)
    given: dict[str, Any] = {"model": str(ARM), **parameters}
    given["model"] = given["model"].format(**{name: tmp_path / f"{name}.xml" for name in texts})
    with rejection(said):
        Bench("rtcf_mujoco/Simulation", path=PATH, **given)


@pytest.mark.parametrize(
    ("inputs", "said"),
    [
        ({"m2": np.array([0.0, math.nan])}, "the command m2 is not finite, or larger than 1e10"),
        ({"push": np.full((2, 6), math.inf)}, "the push is not finite"),
        ({"m1": 1e200}, "the command m1 is not finite, or larger than 1e10"),
        ({"m1": 1e10}, "the simulation diverged"),
    ],
)
def test_a_motion_that_cannot_continue_is_a_fault(inputs: dict[str, Any], said: str) -> None:
    with arm() as bench:
        with pytest.raises(rtcf.RtcfError, match=said):
            bench.run(inputs, steps=100 if "m1" in inputs else None)
        assert bench.run(steps=2)["time"].tolist() == [0.001, 0.002]


def test_the_model_is_fixed_while_loaded(daemon: Daemon, client: rtcf.Client) -> None:
    load(client)
    done = daemon.ctl("set", "sim", "keyframe:=raised")
    assert done.returncode == 1
    assert "/sim: parameter keyframe is fixed at the load" in done.stderr
    assert daemon.ctl("set", "sim", "encoder_counts:=4096").returncode == 0


def test_a_running_simulation_keeps_the_time_of_its_loop(
    daemon: Daemon, client: rtcf.Client
) -> None:
    load(client)
    client.start()
    wait_until_after(client, 300)
    client.stop()
    cycles = iteration(client)
    states = {
        each.name: float(each.value)
        for each in client.get_component("/sim").states
        if each.name == "clock"
    }
    assert states["clock"] == pytest.approx(1e-3 * cycles, abs=2e-3)
    assert not list(Path.cwd().glob("MUJOCO_LOG.TXT"))

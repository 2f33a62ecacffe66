"""JointStatePublisher and JointCommandSubscriber of rtcf_control, connected to other components.

The C++ tests in tests/unit/cpp/control cover names and rejected messages, which a bench cannot
send.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from block_bench import PATH
from rtcf.testing import Bench

MASKED: Any = np.ma

_ARM = """\
components:
  - {name: arm, package: rtcf_control, type: TrajectoryGenerator, breaks: [measured],
     remaps: {measured: /state, command: /command},
     parameters: {joints: shoulder elbow, initial: 0 0.5}}
  - {name: split, package: rtcf_control, type: JointCommandSubscriber,
     remaps: {command: /command, position1: /elbow, position2: /shoulder, velocity1: /elbow_speed,
              velocity2: /shoulder_speed},
     parameters: {joints: elbow shoulder}}
  - {name: limiter, package: rtcf_control, type: JointLimiter,
     remaps: {in: /elbow, out: /elbow_limited}, parameters: {upper: 0.8}}
  - {name: state, package: rtcf_control, type: JointStatePublisher,
     remaps: {position1: /shoulder, position2: /elbow_limited, velocity1: /shoulder_speed,
              velocity2: /elbow_speed, state: /state},
     parameters: {joints: shoulder elbow}}
"""


def test_a_trajectory_passes_through_numbers_and_back(tmp_path: Path) -> None:
    file = tmp_path / "arm.yaml"
    file.write_text(_ARM)
    target = np.tile([-0.5, 1.0], (2500, 1))
    sent = MASKED.array(target, mask=np.arange(2500)[:, None] * np.ones(2) > 0)
    with Bench(str(file), path=PATH) as bench:
        first = bench.run({"/arm.target.position": sent})
        again = bench.run({"/arm.target.position": sent})
    command, state = (first[f"/{port}.position"] for port in ("arm.command", "state.state"))
    assert command[-1].tolist() == [-0.5, 1.0]
    assert state[:, 0].tolist() == command[:, 0].tolist()
    assert state[:, 1].tolist() == np.minimum(command[:, 1], 0.8).tolist()
    assert first["/state.state.velocity"].tobytes() == first["/arm.command.velocity"].tobytes()
    assert first["/state.state.position"].tobytes() == again["/state.state.position"].tobytes()
    assert first["/state.missing"].tolist() == [0.0] * 2500
    assert first["/split.rejected"].tolist() == [0.0] * 2500


def test_nan_and_wrong_sizes_from_outside_do_not_pass() -> None:
    good = np.array([[0.1, 0.2]] * 5)
    bad = good.copy()
    bad[1:4] = [[np.nan, 0.0], [0.0, np.inf], [-np.inf, np.nan]]
    parameters = {"joints": "a b"}
    with Bench("rtcf_control/JointCommandSubscriber", path=PATH, parameters=parameters) as bench:
        found = bench.run({"command.position": bad})
        assert found["position1"].tolist() == [0.1] * 5
        assert found["position2"].tolist() == [0.2] * 5
        assert found["rejected"].tolist() == [0, 1, 2, 3, 3]
        with pytest.raises(KeyError, match="output status has no columns: the messages differ"):
            found["status.data"]
        found = bench.run({"command.position": np.ones((5, 3))})
        assert found["rejected"].tolist() == [1, 2, 3, 4, 5]
        assert "position1" not in found or np.isnan(found["position1"]).all()
        found = bench.run({"command.position": good, "command.effort": good + 1.0})
        assert found["effort2"].tolist() == [1.2] * 5
        said = "command rejected: it does not have one position of each joint"
        assert any(said in line for line in bench.logs)


def test_a_message_by_name_reaches_its_joints() -> None:
    parameters = {"joints": "shoulder elbow"}
    with Bench("rtcf_control/JointCommandSubscriber", path=PATH, parameters=parameters) as bench:
        client = bench.client
        (full_name,) = (each.full_name for each in client.list_components())
        client.write(f"{full_name}.command", {"name": ["elbow", "x", "shoulder"],
                                              "position": [2.0, 9.0, 1.0]})  # fmt: skip
        client.step(1)
        ports = {each.name: each.value for each in client.get_component(full_name).ports}
    assert (ports["position1"], ports["position2"]) == ("data: 1", "data: 2")
    assert "accepted" in ports["status"]

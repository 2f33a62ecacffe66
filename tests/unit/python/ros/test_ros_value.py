"""Values as text become the same messages as with genpy, or an error line."""

import io
import json
from typing import Any

import genpy
import pytest
from geometry_msgs.msg import PoseArray, PoseWithCovariance, Twist, TwistStamped, Vector3
from rtcf.v1 import control_pb2
from rtcfd.access import calls
from rtcfd.common.ros_value import encode
from sensor_msgs.msg import JointState
from std_msgs.msg import (
    Bool,
    ColorRGBA,
    Duration,
    Float64,
    Float64MultiArray,
    Int8,
    String,
    Time,
    UInt8MultiArray,
)
from trajectory_msgs.msg import JointTrajectory


def read(kind: Any, text: str) -> Any:
    """Return the message as genpy reads it."""
    data = encode(kind._full_text, text)
    message = kind()
    message.deserialize(data)
    stream = io.BytesIO()
    message.serialize(stream)
    assert stream.getvalue() == data  # no bytes are left
    return message


@pytest.mark.parametrize(
    ("kind", "text", "expected"),
    [
        (Float64, "-1.5", Float64(-1.5)),
        (Float64, "1e-3", Float64(0.001)),
        (Float64, "{data: 2}", Float64(2.0)),
        (Float64, "-.inf", Float64(-float("inf"))),
        (Float64, "{}", Float64(0.0)),
        (Bool, "true", Bool(True)),
        (Bool, "False", Bool(False)),
        (Int8, "-0x10", Int8(-16)),
        (String, "'yes: no'", String("yes: no")),
        (String, "", String("")),
        (String, "12", String("12")),
        (String, "größer", String("größer")),
        (Time, "1.5", Time(genpy.Time(1, 500_000_000))),
        (Time, "{data: {secs: 7, nsecs: 8}}", Time(genpy.Time(7, 8))),
        (Duration, "-0.25", Duration(genpy.Duration(-1, 750_000_000))),
        (Vector3, "[1, 2, 3]", Vector3(1.0, 2.0, 3.0)),
        (Vector3, "{y: 2}", Vector3(0.0, 2.0, 0.0)),
        (ColorRGBA, "[1, 0, 0, 0.5]", ColorRGBA(1.0, 0.0, 0.0, 0.5)),
        (Twist, "[[1, 2, 3], {z: 4}]", Twist(Vector3(1, 2, 3), Vector3(0, 0, 4))),
        (Float64MultiArray, "[[1, 2], [3, 4]]", Float64MultiArray(data=[1.0, 2.0, 3.0, 4.0])),
        (UInt8MultiArray, "[1, 255]", UInt8MultiArray(data=b"\x01\xff")),
        (JointState, "{name: [a, b], position: [1, 2]}",
         JointState(name=["a", "b"], position=[1.0, 2.0])),
        (JointState, '{"name":["😀"],"position":[-1e-3,Infinity]}',
         JointState(name=["😀"], position=[-0.001, float("inf")])),
        (Bool, '{"data":false}', Bool(False)),
        (String, '{"data":true}', String("true")),
    ],
)  # fmt: skip
def test_a_text_is_a_message(kind: Any, text: str, expected: Any) -> None:
    assert read(kind, text) == expected


def test_a_trajectory_of_1024_points_is_a_message() -> None:
    point = dict.fromkeys(("positions", "velocities", "accelerations"), [-1.0 / 3.0] * 7)
    text = json.dumps({"joint_names": list("abcdefg"), "points": [point] * 1024})
    calls.check_texts(control_pb2.WritePortRequest(component="arm", port="in", value=text))
    points = read(JointTrajectory, text).points
    assert len(points) == 1024
    assert points[-1].accelerations == (-1.0 / 3.0,) * 7


def test_nested_messages_are_created() -> None:
    text = "{header: {frame_id: base, stamp: 3.5}, twist: {linear: {x: 1}}}"
    message = read(TwistStamped, text)
    assert (message.header.frame_id, message.header.stamp) == ("base", genpy.Time(3, 500_000_000))
    assert message.twist.linear.x == 1.0
    covariance = read(PoseWithCovariance, "{covariance: [" + "0.5, " * 35 + "9]}").covariance
    assert covariance == (0.5,) * 35 + (9.0,)
    poses = read(PoseArray, "{poses: [{position: {x: 1}}, {}]}").poses
    assert [each.position.x for each in poses] == [1.0, 0.0]


@pytest.mark.parametrize(
    ("kind", "text", "said"),
    [
        (Float64, "much", 'data: "much" is not a valid float64'),
        (Float64, "", 'data: "" is not a valid float64'),
        (String, "yes: no", "no field yes (fields: data)"),
        (Float64, "[1]", "data: a list is not a valid float64"),
        (Int8, "128", 'data: "128" is not a valid int8'),
        (Int8, "1.0", 'data: "1.0" is not a valid int8'),
        (Bool, "maybe", 'data: "maybe" is not a valid bool'),
        (Time, "-1", 'data: "-1" is not a valid time'),
        (Vector3, "[1, 2]", "a list is not a message: name its fields, as in {x: …, y: …, z: …}"),
        (Vector3, "{w: 1}", "no field w (fields: x, y, z)"),
        (Twist, "{linear: {x: [1]}}", "linear.x: a list is not a valid float64"),
        (PoseWithCovariance, "{covariance: [1]}", "covariance: 1 values, 36 are needed"),
        (JointState, "{name: a}", 'name: "a" is not a list, as in [1, 2]'),
        (JointState, "{position: [1, x]}", 'position[1]: "x" is not a valid float64'),
        (Float64, "{a", "invalid YAML: "),
        (Float64, "[" * 5000, "invalid YAML: "),
        (PoseArray, "{poses: [&a {}, *a]}", "invalid YAML: an alias (*)"),
        (UInt8MultiArray, "[" + "1, " * 30_000 + "]",
         "YAML of 90002 characters is too long, at most 65536: write JSON"),
        (Float64, '{"data": true}', 'data: "true" is not a valid float64'),
        (Float64, '{"data": null}', 'data: "null" is not a valid float64'),
    ],
)  # fmt: skip
def test_unsuitable_values_are_rejected_with_their_place(kind: Any, text: str, said: str) -> None:
    with pytest.raises(ValueError) as error:
        encode(kind._full_text, text)
    assert str(error.value).startswith(said)
    assert "\n" not in str(error.value)

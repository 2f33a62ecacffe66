"""Positions of numbers in serialised ROS messages, compared with genpy."""

import io
import struct
from typing import Any

import pytest
from geometry_msgs.msg import PoseStamped, PoseWithCovariance, TwistStamped
from rtcf_shared.ros_layout import Leaf, leaves, size_of
from sensor_msgs.msg import JointState
from std_msgs.msg import Bool, Float64, Float64MultiArray, Header, MultiArrayDimension, UInt8

_FORMATS = {"?": "?", "i1": "b", "u1": "B", "<i2": "h", "<u2": "H", "<i4": "i", "<u4": "I",
            "<i8": "q", "<u8": "Q", "<f4": "f", "<f8": "d"}  # fmt: skip


def serialised(message: Any) -> bytes:
    stream = io.BytesIO()
    message.serialize(stream)
    return stream.getvalue()


def read(leaf: Leaf, data: bytes) -> Any:
    form = _FORMATS[leaf.format]
    count = 1 if leaf.count is None else leaf.count
    assert struct.calcsize(f"<{form}") == size_of(leaf.format)
    found = struct.unpack_from(f"<{count}{form}", data, leaf.offset)
    return found[0] if leaf.count is None else list(found)


def found(message: Any) -> dict[str, Any]:
    data = serialised(message)
    return {leaf.path: read(leaf, data) for leaf in leaves(message._full_text, data)}


@pytest.mark.parametrize(
    ("message", "value"), [(Float64(-1.5), -1.5), (Bool(True), True), (UInt8(200), 200)]
)
def test_a_message_of_one_field_is_its_value(message: Any, value: object) -> None:
    assert found(message) == {"": value}


def test_fields_of_fields_are_found() -> None:
    message = TwistStamped(header=Header(seq=7, frame_id="base"))
    message.header.stamp.secs, message.header.stamp.nsecs = 12, 34
    message.twist.linear.x, message.twist.angular.z = 1.25, -2.5
    values = found(message)
    assert values["header.seq"] == 7
    assert values["header.stamp"] == [12, 34]
    assert values["twist.linear.x"] == 1.25
    assert values["twist.angular.z"] == -2.5
    assert not any("frame_id" in path for path in values)


def test_the_unit_of_a_port_applies_to_numbers_only_that_can_have_it() -> None:
    message = PoseStamped(header=Header(seq=7, frame_id="base"))
    found = {each.path: each.has_unit for each in leaves(message._full_text, serialised(message))}
    wanted = {f"pose.position.{axis}": True for axis in "xyz"}
    wanted |= {f"pose.orientation.{axis}": False for axis in "xyzw"}
    assert found == wanted | {"header.seq": False, "header.stamp": False}


def test_arrays_of_a_fixed_length_are_found() -> None:
    message = PoseWithCovariance(covariance=[float(i) for i in range(36)])
    message.pose.orientation.w = 1.0
    values = found(message)
    assert values["covariance"] == message.covariance
    assert values["pose.orientation.w"] == 1.0


def test_arrays_have_the_length_of_the_sample() -> None:
    message = JointState(name=["a", "elbow"], position=[1.0, 2.0], effort=[0.5])
    values = found(message)
    assert values["position"] == [1.0, 2.0]
    assert values["velocity"] == []
    assert values["effort"] == [0.5]


def test_the_value_of_a_multi_array_is_its_data() -> None:
    message = Float64MultiArray(data=[1.0, 2.0, 3.0])
    message.layout.dim = [MultiArrayDimension("rows", 3, 3)]
    assert found(message) == {"": [1.0, 2.0, 3.0]}

"""NumPy columns as serialised ROS messages, and back, against ROS's own serialisation."""

from __future__ import annotations

import io
from typing import Any

import numpy as np
import pytest
from geometry_msgs.msg import PoseStamped, Twist, Vector3
from rtcf.testing.messages import pack, unpack
from rtcf.testing.response import held
from sensor_msgs.msg import JointState
from std_msgs.msg import Bool, Float64, Float64MultiArray, Int32


def _text(kind: Any) -> str:
    return str(kind._full_text)


def _read(kind: Any, data: bytes) -> Any:
    message = kind()
    message.deserialize(data)
    return message


def _serialised(message: Any) -> bytes:
    buffer = io.BytesIO()
    message.serialize(buffer)
    return buffer.getvalue()


def test_a_wrapped_number_is_the_column_itself() -> None:
    values = np.array([0.1, -2.5, np.inf])
    data = pack(_text(Float64), {"": values})
    assert [_read(Float64, each).data for each in data] == values.tolist()
    assert unpack(_text(Float64), data)[""].tolist() == values.tolist()
    assert [_read(Bool, each).data for each in pack(_text(Bool), {"": values > 0})] == [1, 0, 1]


def test_fields_are_set_by_path_and_others_are_zero() -> None:
    data = pack(_text(Twist), {"linear.x": np.arange(3.0), "angular.z": np.full(3, 7)})
    for row, each in enumerate(data):
        message = _read(Twist, each)
        assert (message.linear.x, message.linear.y, message.angular.z) == (row, 0, 7)
    columns = unpack(_text(Twist), data)
    assert columns["linear.x"].tolist() == [0, 1, 2]
    assert columns["angular.x"].tolist() == [0, 0, 0]
    stamped = _read(PoseStamped, pack(_text(PoseStamped), {"pose.position.y": np.ones(1)})[0])
    assert (stamped.header.frame_id, stamped.pose.position.y) == ("", 1)


def test_an_array_is_as_long_as_its_column_is_wide() -> None:
    matrix = np.arange(12.0).reshape(2, 2, 3)
    data = pack(_text(Float64MultiArray), {"": matrix})
    assert list(_read(Float64MultiArray, data[1]).data) == [6, 7, 8, 9, 10, 11]
    joints = pack(_text(JointState), {"position": np.ones((2, 6)), "effort": np.ones((2, 3))})
    message = _read(JointState, joints[0])
    assert [len(each) for each in (message.position, message.velocity, message.effort)] == [6, 0, 3]
    assert unpack(_text(JointState), joints)["position"].shape == (2, 6)


def test_messages_written_by_ros_are_read() -> None:
    messages = [Twist() for _ in range(2)]
    messages[1].angular.y = 0.5
    assert unpack(_text(Twist), [_serialised(each) for each in messages])["angular.y"][1] == 0.5


@pytest.mark.parametrize(
    ("kind", "columns", "said"),
    [
        (Twist, {"linear.w": np.zeros(2)}, "no field linear.w; did you mean"),
        (Float64, {"x": np.zeros(2)}, "no field x (fields: (the value itself))"),
        (Float64, {"": np.zeros((2, 3))}, "3 values per cycle instead of 1"),
        (Vector3, {"": np.zeros(2)}, "give a sequence of 3 numbers (fields: x, y, z)"),
        (Int32, {"": np.array([0.5, 1.0])}, "some values do not fit int32"),
        (Int32, {"": np.array([2.0**31, 1.0])}, "some values do not fit int32"),
        (Int32, {"": np.array([np.nan, 1.0])}, "some values do not fit int32"),
    ],
)
def test_unsuitable_columns_are_rejected(kind: Any, columns: dict[str, Any], said: str) -> None:
    with pytest.raises(ValueError, match=".") as error:
        pack(_text(kind), columns)
    assert said in str(error.value)
    assert "\n" not in str(error.value)


def test_a_vector_is_given_as_a_whole() -> None:
    values = np.array([[1.0, 2.0, 3.0], [4.0, 5.0, 6.0]])
    columns = unpack(_text(Vector3), pack(_text(Vector3), {"": values}))
    assert np.array_equal(np.transpose([columns[each] for each in "xyz"]), values)


def test_messages_of_different_lengths_are_rejected() -> None:
    two = [_serialised(JointState(position=[0.0] * n)) for n in (1, 2)]
    with pytest.raises(ValueError, match="messages differ in length"):
        unpack(_text(JointState), two)


def test_a_value_is_held_until_the_next_one() -> None:
    got = held(np.array([1.0, 2.0]), np.array([1, 3]), 5)
    assert np.array_equal(got, [np.nan, 1, 1, 2, 2], equal_nan=True)
    assert held(np.array([[4, 5]]), np.array([1]), 2).tolist() == [[0, 0], [4, 5]]

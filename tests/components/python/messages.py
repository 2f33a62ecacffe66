"""Components with ROS messages of fixed size, and of a size declared by the port."""

import math

import numpy as np
from geometry_msgs.msg import PoseWithCovariance, Twist, TwistStamped
from rtcf.component import Component, Input, Output, Parameter, State
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray

JOINTS = 3
LENGTHS = np.array([0.4, 0.3, 0.1])


class Arm(Component):
    """Drives a planar arm along a twist, by its Jacobian."""

    joints: Input[JointState, JOINTS]
    wanted: Input[TwistStamped]
    torques: Input[Float64MultiArray, 8]
    command: Output[JointState, JOINTS] = Output(
        texts={"header.frame_id": "base", "name": ["shoulder", "elbow", "wrist"]}
    )
    tip: Output[PoseWithCovariance]
    total: Output[float] = Output(unit="N m")
    damping: Parameter[float] = Parameter(0.1, min=0.01, max=1.0)
    filtered: State[np.float64, JOINTS]
    incomplete: State[int]

    def update(self):
        """Command joint speeds, and publish the position of the tip."""
        self.total.write(self.sum_of(self.torques.value.data))
        position = self.joints.value.position
        if not self.joints.new or len(position) < JOINTS:
            self.incomplete += 1
            return
        angle = np.clip(np.cumsum(position), -1e3, 1e3)
        jacobian = np.zeros((2, JOINTS))
        x = y = 0.0
        for i in range(JOINTS - 1, -1, -1):
            x += LENGTHS[i] * math.cos(angle[i])
            y += LENGTHS[i] * math.sin(angle[i])
            jacobian[0, i] = -y
            jacobian[1, i] = x
        if not np.isfinite(x) or not np.isfinite(y):
            return
        self.tip.value.pose.position.x = x
        self.tip.value.pose.position.y = y
        self.tip.value.pose.orientation.w = math.cos(0.5 * angle[JOINTS - 1])
        self.tip.value.pose.orientation.z = math.sin(0.5 * angle[JOINTS - 1])
        self.tip.value.covariance[0] += 1e-6
        self.tip.publish()
        twist = np.array((self.wanted.value.twist.linear.x, self.wanted.value.twist.linear.y))
        twist[:] = np.where(np.isfinite(twist), np.clip(twist, -10.0, 10.0), 0.0)
        inner = jacobian @ jacobian.T + self.damping * np.eye(2)
        speed = jacobian.T @ np.linalg.solve(inner, twist)
        self.filtered += 0.1 * (speed - self.filtered)
        self.command.value.header.stamp = self.stamp
        self.command.value.header.seq = self.wanted.value.header.seq
        self.command.value.velocity[:] = self.filtered
        self.command.value.velocity[0] *= 0.5
        self.command.publish()

    def sum_of(self, values):
        """Return a sum from the first to the last."""
        total = 0.0
        for i in range(len(values)):
            total += values[i]
        return total


class Joints(Component):
    """Simulates an arm."""

    joints: Output[JointState, JOINTS] = Output(texts={"name": ["a", "b", "c"]})
    wanted: Output[TwistStamped] = Output(texts={"header.frame_id": "tip"})
    cycles: State[int]

    def update(self):
        """Swing."""
        self.cycles += 1
        for i in range(JOINTS):
            self.joints.value.position[i] = 0.01 * self.cycles * (i + 1)
        self.joints.value.header.stamp = self.stamp - 5
        self.joints.value.header.seq = self.cycles
        self.joints.publish()
        self.wanted.value.header.seq = self.cycles
        self.wanted.value.twist.linear.x = 0.1
        self.wanted.value.twist.linear.y = -0.2
        self.wanted.publish()


class Crowd(Component):
    """Has more joints than an arm accepts."""

    joints: Output[JointState, JOINTS + 2]

    def update(self):
        """Publish them."""
        self.joints.value.position[:] = 1.0
        self.joints.publish()


class Relay(Component):
    """Copies messages and sets their names."""

    wanted: Input[TwistStamped]
    twist: Output[Twist]
    stamped: Output[TwistStamped]
    speed: State[float]

    def update(self):
        twist = self.wanted.value.twist
        linear = twist.linear
        self.speed = linear.x + linear.y
        self.twist.write(twist)
        out = self.stamped.value
        out.twist = twist
        out.twist.linear.x = 2.0 + linear.x
        self.stamped.publish()

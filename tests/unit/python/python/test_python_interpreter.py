"""Python components in the interpreter, and the examples of their documentation."""

import math
import re
import subprocess
import sys
from pathlib import Path
from typing import Any

import genpy
import pytest
import rtcf
from geometry_msgs.msg import TwistStamped
from pages import TREE
from rtcf.component import Fault
from rtcf_compile.source.modules import components, load
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray

CONTROLLERS = load(TREE / "tests" / "components" / "python" / "controllers.py")
CLASSES = {each.__name__: each for each in components(CONTROLLERS)}

FILTERS = {
    each.__name__: each
    for each in components(load(TREE / "tests" / "components" / "python" / "filters.py"))
}
CHECKED: Any = load(TREE / "tests" / "components" / "python" / "checked.py")
WRITTEN: dict[str, Any] = {
    each.__name__: each
    for each in components(load(TREE / "tests" / "components" / "python" / "written.py"))
}
MESSAGES: dict[str, Any] = {
    each.__name__: each
    for each in components(load(TREE / "tests" / "components" / "python" / "messages.py"))
}
ARM = MESSAGES["Arm"]


def made(name: str, **parameters: object) -> Any:
    return CLASSES[name](**parameters)


def test_the_client_librarys_function_component_still_works() -> None:
    spec = rtcf.component("rtcf_examples", "Mimo", name="H1")
    assert (spec.package, spec.type, spec.name) == ("rtcf_examples", "Mimo", "H1")


def test_a_cycle_reads_computes_and_writes() -> None:
    ramp = made("Ramp", step=3)
    for _ in range(10):
        ramp.cycle()
    assert (ramp.total, ramp.count.value, ramp.even.value) == (30, 30, True)
    assert ramp.seconds.value == pytest.approx(0.01)
    assert ramp.iteration == 10


def test_an_input_is_new_for_one_cycle() -> None:
    observer = made("Observer")
    observer.seconds.put(0.5)
    observer.cycle()
    observer.cycle()
    assert observer.seen == 1
    assert observer.seconds.valid


def test_undeclared_members_are_rejected() -> None:
    ramp = made("Ramp")
    with pytest.raises(AttributeError, match="is not declared"):
        ramp.other = 1.0
    with pytest.raises(AttributeError, match="hooks cannot set"):
        ramp.step = 2
    with pytest.raises(AttributeError, match="is a port"):
        ramp.count = 2
    with pytest.raises(TypeError, match="total is int64"):
        ramp.total = 0.5
    with pytest.raises(ValueError, match="has shape"):
        ramp.pair.write([1.0, 2.0, 3.0])
    with pytest.raises(TypeError, match="no parameter"):
        made("Ramp", steps=2)


def test_a_queue_keeps_the_order_and_counts_dropped_messages() -> None:
    trajectory: Any = FILTERS["Trajectory"]()
    queue = trajectory.waypoints
    assert (queue.size, queue.age, queue.connected) == (0, -1, False)
    with pytest.raises(IndexError, match="empty queue"):
        _ = queue.front
    for number in range(6):
        queue.put([number, 0.0, 1.0])
    assert (queue.size, queue.dropped, queue.connected) == (4, 2, True)
    for number in range(3):
        assert queue.front[0] == number
        queue.pop()
    queue.put([7.0, 0.0, 1.0])
    queue.pop()
    assert (queue.front[0], queue.size) == (7.0, 1)
    with pytest.raises(ValueError, match="has shape"):
        queue.put([1.0, 2.0])


def test_the_age_of_a_queue_is_its_oldest_messages_age() -> None:
    trajectory: Any = FILTERS["Trajectory"]()
    trajectory.hold.put(True)
    for number in range(3):
        trajectory.waypoints.put([float(number), 0.0, 1.0])
        trajectory.cycle()
    assert (trajectory.skipped, trajectory.waypoints.age) == (1, 2_000_000)


def test_derived_values_exist_from_the_start() -> None:
    short, long = made("Pendulum", length=0.2), made("Pendulum", length=1.5)
    assert (short.slow, long.slow) == (False, True)
    assert short.ad[1, 0] < long.ad[1, 0] < 0.0
    with pytest.raises(ValueError, match="stiffer than the drive"):
        made("Pendulum", gains=[99.5, 1.0])


def test_message_fields_are_read_and_written_by_name() -> None:
    arm = ARM()
    arm.joints.put(JointState(position=[0.1, 0.2, 0.3]))
    arm.torques.put(Float64MultiArray(data=[1.0, 2.0]))
    wanted = TwistStamped()
    wanted.header.seq, wanted.header.stamp = 7, genpy.Time(3, 4)
    wanted.twist.linear.x = 0.5
    arm.wanted.put(wanted)
    arm.cycle()
    assert arm.total.value == 3.0
    assert arm.wanted.value.header.stamp == 3_000_000_004
    assert arm.command.value.header.seq == 7
    assert arm.command.written and arm.tip.written
    assert 0.7 < arm.tip.value.pose.position.x < 0.8
    assert list(arm.joints.value.velocity) == []


def test_a_message_longer_than_declared_is_rejected() -> None:
    arm = ARM()
    arm.joints.put(JointState(position=[0.1, 0.2, 0.3, 0.4]))
    assert not arm.joints.new and not arm.joints.valid
    arm.cycle()
    assert arm.incomplete == 1


def test_unknown_message_fields_are_rejected() -> None:
    arm = ARM()
    with pytest.raises(AttributeError, match="TwistStamped has no number twist.linear.w"):
        _ = arm.wanted.value.twist.linear.w
    with pytest.raises(AttributeError, match="is an input"):
        arm.wanted.value.twist.linear.x = 1.0
    with pytest.raises(AttributeError, match="no number twist"):
        arm.tip.value.twist = 1.0
    with pytest.raises(TypeError, match="seq is uint32"):
        arm.command.value.header.seq = 0.5
    with pytest.raises(TypeError, match="set .value"):
        arm.tip.write(1.0)


def test_readers_of_a_finite_output_keep_its_last_finite_value() -> None:
    guarded: Any = CHECKED.Guarded()
    for given in (2.0, math.nan):
        guarded.u.put(given)
        guarded.cycle()
    assert (guarded.y.value, list(guarded.pair.value)) == (2.0, [2.0, -2.0])
    assert not guarded.y.written and not guarded.pair.written
    # The component itself reads its own value.
    assert math.isnan(guarded.last) and math.isnan(guarded.unchecked.value)
    said = "output {} is not finite: readers keep its last value"
    assert guarded.log == [("error", said.format("y")), ("error", said.format("pair"))]
    guarded.quiet = True
    guarded.cycle()
    assert guarded.y.value == 2.0 and len(guarded.log) == 2, "the cycle wrote nothing"
    guarded.quiet = False
    guarded.u.put(3.0)
    guarded.cycle()
    assert (guarded.y.value, guarded.y.written) == (3.0, True)
    # The value written in the previous cycle.
    assert math.isnan(guarded.before)


def test_a_finite_output_without_finite_values_has_none() -> None:
    guarded: Any = CHECKED.Guarded()
    guarded.u.put(math.inf)
    guarded.cycle()
    assert (guarded.y.value, guarded.y.written) == (0.0, False)


def test_an_enum_can_be_given_by_name() -> None:
    switched: Any = CHECKED.Switched(mode="RUN")
    assert switched.mode is CHECKED.Mode.RUN
    switched.wanted.put("IDLE")
    switched.queued.put("RUN")
    assert switched.wanted.value is CHECKED.Mode.IDLE
    assert switched.queued.front == CHECKED.Mode.RUN
    with pytest.raises(ValueError, match="mode is 'run', which is none of IDLE, RUN"):
        CHECKED.Switched(mode="run")
    with pytest.raises(ValueError, match="wanted is 7, which is none of IDLE, RUN"):
        switched.wanted.put(7)


def test_an_array_of_bools_is_a_parameter() -> None:
    axes = made("Axes", enabled=[False, True, True])
    assert (axes.enabled.tolist(), axes.many) == ([False, True, True], 3)
    axes.u.put([5.0, 6.0, 7.0])
    axes.cycle()
    assert axes.y.value.tolist() == [1.0, 6.0, 10.0]
    with pytest.raises(TypeError, match="enabled is bool, not int64"):
        made("Axes", enabled=[0, 1, 1])
    with pytest.raises(ValueError, match="no axis"):
        made("Axes", enabled=False, plan=False)


def test_a_fault_is_an_exception() -> None:
    failing = made("Failing", way=4, after=1)
    with pytest.raises(Fault, match="no reply from the drive"):
        failing.cycle()


def test_a_state_is_none_until_it_is_set() -> None:
    unknown: Any = WRITTEN["Unknown"]()
    assert (unknown.last, unknown.first, unknown.row, unknown.way) == (None, 2.0, None, None)
    unknown.last, unknown.row = 0.5, [1.0, 2.0, 3.0]
    assert (unknown.last, list(unknown.row)) == (0.5, [1.0, 2.0, 3.0])
    unknown.last = None
    assert unknown.last is None


def test_an_enum_accepts_only_its_values() -> None:
    unknown: Any = WRITTEN["Unknown"]()
    unknown.mode = 4
    assert repr(unknown.mode) == "<Mode.HOLD: 4>"
    with pytest.raises(ValueError, match="3 is not a valid Mode"):
        unknown.mode = 3


def test_bases_and_mixins_work_as_in_python() -> None:
    inherited = WRITTEN["InheritedAgain"](bound=0.5)
    inherited.start()
    assert (inherited.z, inherited.turns, inherited.wide) == (1.0, 3, False)
    inherited.u.put(9.0)
    inherited.cycle()
    assert (inherited.turns, inherited.count.value) == (4, 1)


def test_a_message_is_copied_whole_or_in_parts() -> None:
    relay: Any = MESSAGES["Relay"]()
    message = TwistStamped()
    message.twist.linear.x, message.twist.angular.z = 1.0, 2.0
    relay.wanted.put(message)
    relay.cycle()
    assert relay.twist.value.linear.x == 1.0
    assert (relay.stamped.value.twist.linear.x, relay.stamped.value.twist.angular.z) == (3.0, 2.0)
    with pytest.raises(TypeError, match="frame_id is not copied"):
        relay.stamped.write(relay.wanted.value)


def test_instances_have_separate_state() -> None:
    first, second = made("Ramp"), made("Ramp")
    first.cycle()
    assert (first.total, second.total) == (1, 0)


def test_the_docs_example_runs_unchanged(tmp_path: Path) -> None:
    page = (TREE / "docs" / "python-components.md").read_text()
    source, *others = re.findall(r"^```python\n(.*?)^```", page, re.MULTILINE | re.DOTALL)
    (trial,) = (each for each in others if "import Observer" in each)
    (tmp_path / "observer.py").write_text(source)
    done = subprocess.run(
        [sys.executable, "-c", trial],
        env={"PYTHONPATH": f"{tmp_path}:{TREE / 'build' / 'python'}"},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr


def test_texts_with_braces_are_logged_as_written() -> None:
    component = made("Integrator")
    component.warn(f"{'a{}'} {1.5:.1f}")
    component.warn("{:.2f} {{}}", 2.0)
    assert component.log == [("warn", "a{} 1.5"), ("warn", "2.00 {}")]
    with pytest.raises(IndexError):
        component.warn("{} {}", 1.0)

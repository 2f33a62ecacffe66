"""Components in Python as the interpreter runs them, and the examples of their documentation."""

import re
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
import rtcf
from rtcf.component import Fault
from rtcf_compile.source.modules import components, load

TREE = Path(__file__).parents[3]
CONTROLLERS = load(TREE / "tests" / "components" / "python" / "controllers.py")
CLASSES = {each.__name__: each for each in components(CONTROLLERS)}

FILTERS = {
    each.__name__: each
    for each in components(load(TREE / "tests" / "components" / "python" / "filters.py"))
}


def made(name: str, **parameters: object) -> Any:
    return CLASSES[name](**parameters)


def test_the_client_librarys_function_of_that_name_is_there_too() -> None:
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


def test_what_is_not_declared_is_refused() -> None:
    ramp = made("Ramp")
    with pytest.raises(AttributeError, match="is not declared"):
        ramp.other = 1.0
    with pytest.raises(AttributeError, match="is set from outside"):
        ramp.step = 2
    with pytest.raises(AttributeError, match="is a port"):
        ramp.count = 2
    with pytest.raises(TypeError, match="total is int64"):
        ramp.total = 0.5
    with pytest.raises(ValueError, match="has shape"):
        ramp.pair.write([1.0, 2.0, 3.0])
    with pytest.raises(TypeError, match="no parameter"):
        made("Ramp", steps=2)


def test_a_queue_keeps_messages_in_order_and_counts_those_it_has_no_room_for() -> None:
    queue = FILTERS["Trajectory"]().waypoints
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


def test_the_age_of_a_queue_is_that_of_its_oldest_message() -> None:
    trajectory = FILTERS["Trajectory"]()
    trajectory.hold.put(True)
    for number in range(3):
        trajectory.waypoints.put([float(number), 0.0, 1.0])
        trajectory.cycle()
    assert (trajectory.skipped, trajectory.waypoints.age) == (1, 2_000_000)


def test_a_fault_is_an_exception() -> None:
    failing = made("Failing", way=4, after=1)
    with pytest.raises(Fault, match="no reply from the drive"):
        failing.cycle()


def test_instances_have_state_of_their_own() -> None:
    first, second = made("Ramp"), made("Ramp")
    first.cycle()
    assert (first.total, second.total) == (1, 0)


def test_the_pages_example_runs_as_it_stands(tmp_path: Path) -> None:
    page = (TREE / "docs" / "python-components.md").read_text()
    source, trial = re.findall(r"^```python\n(.*?)^```", page, re.MULTILINE | re.DOTALL)[:2]
    (tmp_path / "observer.py").write_text(source)
    done = subprocess.run(
        [sys.executable, "-c", trial],
        env={"PYTHONPATH": f"{tmp_path}:{TREE / 'build' / 'python'}"},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr

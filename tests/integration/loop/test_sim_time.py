"""A loop that follows /clock: its cycles, their times, and its inputs."""

import re
import subprocess
from collections.abc import Iterator
from pathlib import Path

import pytest
import rosbag
import rosgraph
import rospy
import rtcf
from daemon_process import DEADLINE_S, Daemon, wait_for, wait_until_it_is, with_ros
from pages import SUPPORT
from ros_processes import Master
from rtcf.v1 import runner_pb2
from std_msgs.msg import Float64
from values import is_among, iteration, state

SECOND = 1_000_000_000
_PEER = SUPPORT / "clock_peer.py"


class Clock:
    """A node that publishes /clock."""

    def __init__(self, master: Master, folder: Path) -> None:
        self._process = subprocess.Popen(
            ["/usr/bin/python3", str(_PEER), "tick"],
            env=master.environment(),
            cwd=folder,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
        )

    def wait_until_connected(self) -> None:
        """Wait until all subscribers are connected."""
        assert self._process.stdout is not None
        assert self._process.stdout.readline() == "connected\n"

    def tick(self, *ticks_ns: int) -> None:
        """Publish these times, one after another."""
        assert self._process.stdin is not None
        self._process.stdin.write("".join(f"{tick}\n" for tick in ticks_ns))
        self._process.stdin.flush()

    def end(self) -> None:
        """End it."""
        self._process.kill()
        self._process.communicate(timeout=DEADLINE_S)


@pytest.fixture
def simulated(master: Master) -> Iterator[Master]:
    """Yield a master whose nodes follow /clock."""
    parameters = rosgraph.Master("/test", master.uri)
    parameters.setParam("/use_sim_time", True)
    yield master
    parameters.deleteParam("/use_sim_time")


@pytest.fixture
def daemon(tmp_path: Path, simulated: Master) -> Iterator[Daemon]:
    """Yield a daemon with this master."""
    daemon = Daemon(tmp_path, with_ros(simulated.uri, "/in|/out"))
    daemon.start()
    yield daemon
    daemon.end()


@pytest.fixture
def client(daemon: Daemon) -> Iterator[rtcf.Client]:
    """Yield a client of the daemon, whose loop counts its cycles and forwards /in."""
    with rtcf.Client(daemon.socket) as client:
        client.set_runner(runner_pb2.RunnerSettings(frequency_hz=1000.0, max_clock_jump_s=2.0))
        client.load(
            rtcf.component(
                "rtcf_examples", "Identity", name="pass", remaps=["in:=/in", "out:=/out"]
            )
        )
        yield client


@pytest.fixture
def clock(tmp_path: Path, simulated: Master, client: rtcf.Client) -> Iterator[Clock]:
    """Yield a clock to which a running loop is connected."""
    client.start()
    node = state(client).ros.node
    wait_for(lambda: node in simulated.subscribers("/clock"), "the loop's subscription")
    clock = Clock(simulated, tmp_path)
    clock.wait_until_connected()
    yield clock
    clock.end()


def _wait_for_exactly(client: rtcf.Client, cycles: int) -> None:
    try:
        wait_for(lambda: iteration(client) >= cycles, f"cycle {cycles}")
    finally:
        assert iteration(client) == cycles


@pytest.mark.parametrize("rate_hz", [100, 999, 1001])
def test_a_clock_of_any_rate_gives_the_exact_number_of_cycles(
    client: rtcf.Client, clock: Clock, rate_hz: int
) -> None:
    status = state(client)
    assert status.simulated
    assert status.iteration == 0
    seconds = 5
    clock.tick(*(k * SECOND // rate_hz for k in range(1, seconds * rate_hz + 1)))
    # From the first tick to the last one, both included.
    first, last = SECOND // rate_hz, seconds * SECOND
    _wait_for_exactly(client, (last - first) // 1_000_000 + 1)


def test_a_stopped_clock_stops_only_the_loop(client: rtcf.Client, clock: Clock) -> None:
    clock.tick(5 * SECOND, 5 * SECOND, 5 * SECOND + 10_000_000)
    _wait_for_exactly(client, 11)
    # Changes and queries do not wait for the clock.
    client.load(rtcf.component("rtcf_examples", "Identity", name="more", remaps=["out:=/more"]))
    client.unload(["more"])
    assert [info.full_name for info in client.list_components()] == ["/pass"]
    clock.tick(5 * SECOND + 20_000_000)
    _wait_for_exactly(client, 21)
    client.stop()
    assert state(client).state == runner_pb2.RUNNER_STATE_STOPPED


def test_a_jump_of_the_clock_runs_one_cycle_and_is_reported(
    client: rtcf.Client, clock: Clock, tmp_path: Path
) -> None:
    clock.tick(SECOND, SECOND + 5_000_000)
    _wait_for_exactly(client, 6)
    clock.tick(0, 3_000_000)  # a bag that starts again
    _wait_for_exactly(client, 10)
    clock.tick(60 * SECOND)  # further than max_clock_jump_s
    _wait_for_exactly(client, 11)
    log = tmp_path / "log"
    wait_for(lambda: "jumped from 0.003000000 s to 60.0" in log.read_text(), "the jump's event")
    assert log.read_text().count("the simulated clock jumped from") == 2
    assert log.read_text().count("the simulated clock begins at 1.000000000 s") == 1


def test_short_steps_back_of_the_clock_are_waited_out_and_summarised(
    client: rtcf.Client, clock: Clock, daemon: Daemon
) -> None:
    # Each fifth tick is 8 ms earlier than the one before it.
    late = [18_000_000 if k % 5 == 4 else 0 for k in range(201)]
    clock.tick(*(SECOND + k * 10_000_000 - late[k] for k in range(201)))
    _wait_for_exactly(client, 2001)
    client.stop()
    counts = re.findall(
        r"the simulated clock went back (\S+)(?: times)?, by 0\.008000000 s at most", daemon.log()
    )
    assert sum(1 if count == "once" else int(count) for count in counts) == 40
    assert daemon.log().count("the simulated clock") <= 3  # with the first tick


def test_many_jumps_of_the_clock_are_summarised(
    client: rtcf.Client, clock: Clock, daemon: Daemon
) -> None:
    clock.tick(*(SECOND * (1 + k % 2) for k in range(100)))  # a bag that is repeated
    _wait_for_exactly(client, 50 + 50 * 1000)
    client.stop()
    lines = daemon.log().count("the simulated clock jumped from")
    more = re.findall(r"the simulated clock jumped ([0-9]+) more times", daemon.log())
    assert lines + sum(map(int, more)) == 49
    assert lines <= 10


def test_a_silent_clock_is_reported(
    client: rtcf.Client, daemon: Daemon, simulated: Master, tmp_path: Path
) -> None:
    client.start()
    silence = "no cycle runs: no message on /clock for "
    wait_for(lambda: silence in state(client).clock_silence, "the report of a silent clock")
    shown = daemon.ctl("status").stdout
    assert "running, simulated" in shown
    assert f"rt_runner: {silence}" in shown
    assert f"runner rt_runner: {silence}" in daemon.ctl("doctor", "--seconds", "0").stdout
    wait_for(lambda: silence in daemon.log(), "the event")
    assert daemon.log().count(silence) == 1
    wait_for(
        lambda: f"running: {silence}" in simulated.run("rostopic", "echo", "-n1", "/diagnostics"),
        "the warning in /diagnostics",
    )
    clock = Clock(simulated, tmp_path)
    clock.wait_until_connected()
    clock.tick(SECOND, SECOND + 5_000_000)
    _wait_for_exactly(client, 6)
    wait_for(lambda: "/clock has been at 1.005" in state(client).clock_silence, "a stopped clock")
    clock.end()


def test_published_stamps_have_simulated_time(
    client: rtcf.Client, clock: Clock, simulated: Master
) -> None:
    listener = simulated.node("rosout", state(client).ros.node)
    listener.wait_until_connected()
    clock.tick(SECOND, SECOND + 5_000_000, 60 * SECOND)
    jump = wait_for(
        lambda: [each for each in listener.records() if "simulated clock jumped" in each["msg"]],
        "the jump's record",
    )
    assert [each["stamp"] for each in jump] == [60.0]
    listener.end()

    def stamp() -> str:
        return simulated.run("rostopic", "echo", "-n1", "/diagnostics/header/stamp")

    wait_for(lambda: "secs: 60\n" in stamp(), "diagnostics of that second")


def test_a_loop_can_ignore_the_clock(client: rtcf.Client) -> None:
    client.set_runner(runner_pb2.RunnerSettings(sim_time=runner_pb2.SIM_TIME_NEVER))
    client.start()
    wait_for(lambda: iteration(client) > 10, "cycles in real time")
    assert not state(client).simulated


def _play(
    client: rtcf.Client,
    simulated: Master,
    folder: Path,
    values: list[float],
    *,
    slower: int = 1,
    clock_peers: int = 0,
) -> None:
    """Play a bag of these values, 100 per second, and some more time, to the loop and some peers,
    with a tick per two values."""
    bag_file = folder / "in.bag"
    with rosbag.Bag(str(bag_file), "w") as bag:
        for index, value in enumerate(values):
            bag.write("/in", Float64(value), rospy.Time.from_sec(1000.0 + index / 100.0))
        # A tick must follow the last value.
        bag.write("/end", Float64(), rospy.Time.from_sec(1000.2 + len(values) / 100.0))
    loop = state(client).ros.node
    with subprocess.Popen(
        [
            *("/usr/bin/rosbag", "play", "--clock", f"--hz={50 / slower}", f"--rate={1 / slower}"),
            *("--pause", "--quiet", str(bag_file)),
        ],
        env=simulated.environment(),
        stdin=subprocess.DEVNULL,
        stdout=subprocess.DEVNULL,
    ) as playing:
        try:
            player = wait_for(lambda: _player(simulated), "the player")

            def heard() -> bool:
                clock = simulated.listeners(player, "/clock")
                peers = sum(name.startswith("/clock_peer") for name in clock)
                there = loop in clock and loop in simulated.listeners(player, "/in")
                return there and peers == clock_peers

            wait_for(heard, "all subscribers of the player")
            simulated.call(f"{player}/pause_playback", "{data: false}")
            assert playing.wait(DEADLINE_S) == 0
        finally:
            playing.terminate()


def _player(simulated: Master) -> str:
    """Return the node that plays a bag, once it can be resumed; else an empty text."""
    services = (name.rpartition("/") for name in simulated.services())
    return next((node for node, _, name in services if name == "pause_playback"), "")


def test_a_topic_faster_than_the_loop_is_decimated_not_delayed(
    client: rtcf.Client, simulated: Master, tmp_path: Path
) -> None:
    client.set_runner(runner_pb2.RunnerSettings(frequency_hz=10.0))
    client.start()
    out = simulated.node("record", "/out")
    out.wait_until_connected()
    _play(client, simulated, tmp_path, [float(k) for k in range(1, 201)])
    wait_for(lambda: 200.0 in out.values(), "the newest value")
    passed = out.values()
    # One per cycle; two seconds of input and some time without.
    assert len(passed) <= iteration(client) < 40
    assert passed == sorted(passed)
    wait_for(lambda: state(client).ros.passed_over == 200 - len(passed), "the count of the others")
    out.end()


def test_a_played_bag_loses_no_input_and_no_cycle(
    client: rtcf.Client, simulated: Master, tmp_path: Path
) -> None:
    values = [float(k) for k in range(1, 101)]
    client.start()
    out = simulated.node("record", "/out")
    out.wait_until_connected()
    heard = tmp_path / "ticks"
    with heard.open("wb") as to:
        ticks = subprocess.Popen(
            ["/usr/bin/python3", str(_PEER), "record"], env=simulated.environment(), stdout=to
        )

    def shown() -> list[int]:
        return [int(line) for line in heard.read_text().split("\n")[:-1] if line.isdigit()]

    try:
        # So slowly that values arrive separately. On a busy machine some may arrive together; then
        # the newest applies.
        _play(client, simulated, tmp_path, values, slower=10, clock_peers=1)

        def lost() -> int:
            return int(state(client).ros.passed_over)

        wait_until_it_is(len(values), lambda: lost() + len(out.values()), "the number of values")
        # Without a queue, one of the two values between ticks would be lost each time.
        assert lost() < 0.4 * len(values)
        assert is_among(out.values(), values)
        out.end()
        begin = re.search(r"clock begins at (\d+)\.(\d{9}) s", (tmp_path / "log").read_text())
        assert begin
        first = int(begin[1] + begin[2])
        assert first in shown()
        # The clock has stopped: both receive the remaining ticks eventually.
        wait_until_it_is(
            0,
            lambda: iteration(client) - (shown()[-1] - first) // 1_000_000 - 1,
            "cycles too many",
        )
    finally:
        ticks.terminate()
        ticks.wait(DEADLINE_S)

"""Rights of ROS peers over a loop, and the masters that a loop follows."""

import subprocess
from collections.abc import Iterator
from pathlib import Path

import pytest
import rosgraph
import rtcf
from daemon_process import Daemon, clean_environment, wait_for, with_ros
from launch_processes import Launching
from ros_processes import Master, reserve_port
from rtcf.v1 import runner_pb2
from values import iteration

_NOBODY = 65534
_KNOBS = "/arm/knobs"


@pytest.fixture(params=["none", "observe", "tune", "operate"])
def peers(request: pytest.FixtureRequest) -> str:
    """Return a right of ROS peers."""
    return str(request.param)


def _load(client: rtcf.Client) -> None:
    client.set_runner(runner_pb2.RunnerSettings(frequency_hz=200.0))
    client.load(rtcf.component("rtcf_test", "Knobs", name="knobs", ns="/arm"))
    client.load(
        rtcf.component("rtcf_test_ros", "Text", name="text", ns="/arm", remaps=["length:=words"])
    )
    client.start()


def _rate(client: rtcf.Client) -> float:
    (rate,) = (each for each in client.get_component(_KNOBS).parameters if each.name == "rate")
    return float(rate.value.double_value)


def test_peers_have_the_right_of_the_setting(tmp_path: Path, master: Master, peers: str) -> None:
    daemon = Daemon(tmp_path, with_ros(master.uri, "/arm/heard") + f'peers = "{peers}"\n')
    daemon.start()
    try:
        with rtcf.Client(daemon.socket) as client:
            _load(client)
            wait_for(lambda: f"{_KNOBS}/set_parameters" in master.services(), "the service")
            wait_for(lambda: master.parameter(f"{_KNOBS}/rate") == 1.5, "the parameter server")
            tunes = peers in ("tune", "operate")
            answer = master.call(
                f"{_KNOBS}/set_parameters", "{config: {doubles: [{name: rate, value: 2.5}]}}"
            )
            shown = {each["name"]: each["value"] for each in answer["config"]["doubles"]}
            assert shown["rate"] == (2.5 if tunes else 1.5)
            # Wait for its own write to the server before overwriting the value.
            wait_for(lambda: master.parameter(f"{_KNOBS}/rate") == shown["rate"], "its write")
            master.run("rosparam", "set", f"{_KNOBS}/rate", "4.0")
            if tunes:
                wait_for(lambda: _rate(client) == 4.0, "the loop to follow the change")
            else:
                wait_for(lambda: master.parameter(f"{_KNOBS}/rate") == 1.5, "the present values")
                assert _rate(client) == 1.5
            if peers == "operate":
                wait_for(lambda: "/arm/heard" in master.topics()[1], "the topic")
            else:
                assert "/arm/heard" not in master.topics()[1]
    finally:
        daemon.end()
        master.run("rosparam", "delete", _KNOBS, ok=True)


@pytest.fixture
def strangers_master(tmp_path: Path) -> Iterator[str]:
    """Yield the URI of a master started by another user of this machine."""
    port = reserve_port()
    uri = f"http://localhost:{port}"
    home = tmp_path / "stranger"
    home.mkdir()
    home.chmod(0o777)
    environment = clean_environment() | {
        "ROS_MASTER_URI": uri, "ROS_HOSTNAME": "localhost",
        "ROS_HOME": "/tmp", "ROS_LOG_DIR": "/tmp", "HOME": "/tmp",
    }  # fmt: skip
    process = subprocess.Popen(
        ["/usr/bin/rosmaster", "--core", "-p", str(port)],
        env=environment, user=_NOBODY, group=_NOBODY, cwd="/",
        stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
    )  # fmt: skip
    yield uri
    process.terminate()
    process.wait()


def test_a_master_of_a_user_without_the_right_is_not_followed(
    tmp_path: Path, strangers_master: str
) -> None:
    daemon = Daemon(tmp_path, with_ros(strangers_master, ".*"))
    daemon.start()
    try:
        with rtcf.Client(daemon.socket) as client:
            _load(client)

            def problem() -> str:
                return str(client.get_status("rt_runner").runners[0].ros.problem)

            wait_for(lambda: f"belongs to user {_NOBODY}" in problem(), "the status to say so")
            ros = client.get_status("rt_runner").runners[0].ros
            assert (ros.connected, ros.publications, ros.subscriptions) == (False, 0, 0)
    finally:
        daemon.end()


@pytest.mark.parametrize(
    ("peers", "choice", "simulated"),
    [
        ("observe", runner_pb2.SIM_TIME_AUTO, False),
        ("operate", runner_pb2.SIM_TIME_AUTO, True),
        ("observe", runner_pb2.SIM_TIME_ALWAYS, True),
    ],
)
def test_a_foreign_master_sets_simulated_time_only_with_operate(
    tmp_path: Path, master: Master, peers: str, choice: runner_pb2.SimTime, simulated: bool
) -> None:
    parameters = rosgraph.Master("/test", master.uri)
    parameters.setParam("/use_sim_time", True)
    daemon = Daemon(tmp_path, with_ros(master.uri, "") + f'peers = "{peers}"\n')
    daemon.start()
    try:
        with rtcf.Client(daemon.socket) as client:
            client.set_runner(runner_pb2.RunnerSettings(frequency_hz=200.0, sim_time=choice))
            wait_for(lambda: client.get_status("rt_runner").runners[0].ros.connected, "the node")
            client.load(rtcf.component("rtcf_test", "Knobs", name="knobs", ns="/arm"))
            client.start()
            assert client.get_status("rt_runner").runners[0].simulated == simulated
            if simulated:  # without a clock no cycle runs
                wait_for(lambda: "/clock" in master.topics()[1], "the topic of the clock")
                assert iteration(client) == 0
            else:
                wait_for(lambda: iteration(client) > 10, "the loop to run in real time")
    finally:
        daemon.end()
        parameters.deleteParam("/use_sim_time")


@pytest.mark.parametrize(
    ("said", "right"),
    [
        ((), runner_pb2.RIGHT_ADMIN),
        (("_ros_peers:=tune",), runner_pb2.RIGHT_TUNE),
        (("_ros_peers:=observe",), runner_pb2.RIGHT_OBSERVE),
    ],
)
def test_peers_of_a_launch_have_its_users_rights_by_default(
    tmp_path: Path, master: Master, said: tuple[str, ...], right: runner_pb2.Right
) -> None:
    daemon = Daemon(tmp_path, with_ros(master.uri, "") + 'peers = "none"\n')
    daemon.start()
    launching = Launching(master, tmp_path, daemon.socket)
    launching.forget()
    try:
        runner = launching.node("rt_runner", *said)
        runner.wait_for_output("the loop runs")
        assert "system daemon at" in runner.output()
        with rtcf.Client(daemon.socket) as client:
            client.load(rtcf.component("rtcf_test", "Knobs", name="knobs", ns="/arm"))
            wait_for(lambda: f"{_KNOBS}/set_parameters" in master.services(), "the service")
            answer = master.call(
                f"{_KNOBS}/set_parameters", "{config: {doubles: [{name: rate, value: 2.5}]}}"
            )
            shown = {each["name"]: each["value"] for each in answer["config"]["doubles"]}
            assert shown["rate"] == (1.5 if right == runner_pb2.RIGHT_OBSERVE else 2.5)
            wait_for(lambda: "/rt_runner/deactivate_rt_loop" in master.services(), "the services")
            answer = master.call("/rt_runner/deactivate_rt_loop")
            assert answer["success"] == (right == runner_pb2.RIGHT_ADMIN), answer
            assert client.get_status("rt_runner").runners[0].settings.ros.peers == right
            # Afterwards the runner has its own setting again.
            assert runner.end() == 0
            settings = client.get_status("rt_runner").runners[0].settings
            assert settings.ros.peers == runner_pb2.RIGHT_NONE
    finally:
        launching.end()
        daemon.end()

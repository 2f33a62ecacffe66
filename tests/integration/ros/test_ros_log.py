"""Log records of components on /rosout and in rtcfd's log, and levels set by rqt_logger_level."""

import time
from collections.abc import Iterator
from pathlib import Path

import pytest
import rtcf
from daemon_process import Daemon, wait_for, with_ros
from ros_processes import Master, Node
from rtcf.v1 import runner_pb2
from values import iteration

_INFO, _WARN, _DEBUG = 2, 4, 1


@pytest.fixture
def speaking(tmp_path: Path, master: Master) -> Iterator[tuple[Daemon, rtcf.Client, Node, str]]:
    """Yield a daemon, its client, a node that receives /rosout, and the name of the loop's node."""
    daemon = Daemon(tmp_path, with_ros(master.uri, ""))
    daemon.start()
    with rtcf.Client(daemon.socket) as client:
        client.set_runner(runner_pb2.RunnerSettings(frequency_hz=50.0))
        wait_for(lambda: client.get_status("rt_runner").runners[0].ros.connected, "the node")
        node = client.get_status("rt_runner").runners[0].ros.node
        listener = master.node("rosout", node)
        listener.wait_until_connected()
        yield daemon, client, listener, node
        listener.end()
    daemon.end()


def logged(daemon: Daemon, text: str) -> str:
    """Return the line of rtcfd's log with a text, once it exists."""

    def found() -> str:
        return next((line for line in daemon.log().splitlines() if text in line), "")

    line: str = wait_for(found, f"{text!r} in the log")
    return line


def test_every_record_is_on_rosout_and_in_the_log_with_its_component(
    speaking: tuple[Daemon, rtcf.Client, Node, str],
) -> None:
    daemon, client, listener, node = speaking
    begin = time.time()
    client.load(rtcf.component("rtcf_test_ros", "Speaker", name="speaker", ns="/arm"))
    client.start()

    def record(text: str) -> dict[str, object]:
        found: dict[str, object] = wait_for(
            lambda: next((each for each in listener.records() if each["msg"] == text), None), text
        )
        return found

    for text, level in (("by macro at 1", _INFO), ("by rtcf at 1", _INFO), ("in the cycle", _WARN)):
        found = record(text)
        assert found["name"] == "/arm/speaker"
        assert found["level"] == level
        assert str(found["file"]).endswith("tests/components/speaker.cpp")
        assert found["line"] != 0
        assert begin - 1.0 < float(str(found["stamp"])) < time.time() + 1.0
        line = logged(daemon, text)
        assert "/arm/speaker" in line
        assert "speaker.cpp:" in line
    assert "for those who debug" not in daemon.log()
    # Records of the executor itself have the node's name, as for any node.
    client.stop()
    assert all(each["name"] in ("/arm/speaker", node) for each in listener.records())


def test_rqt_logger_level_can_set_levels(
    speaking: tuple[Daemon, rtcf.Client, Node, str], master: Master
) -> None:
    daemon, client, listener, node = speaking
    client.load(rtcf.component("rtcf_test_ros", "Speaker", name="speaker"))
    client.load(rtcf.component("rtcf_test_ros", "Speaker", name="other"))
    client.start()

    def levels() -> dict[str, str]:
        answer = master.call(f"{node}/get_loggers")
        return {each["name"]: each["level"] for each in answer["loggers"]}

    before = levels()
    assert before["ros.rtcf.speaker"] == before["ros.rtcf"] == before["ros"] == "info"
    master.call(f"{node}/set_logger_level", "{logger: ros.rtcf.speaker, level: debug}")
    # For a component in the cycle, and for this one only.
    debug = wait_for(
        lambda: [each for each in listener.records() if each["msg"] == "each cycle"], "a record"
    )
    assert {(each["name"], each["level"]) for each in debug} == {("/speaker", _DEBUG)}
    wait_for(lambda: "each cycle" in daemon.log(), "the record in the log")
    assert levels()["ros.rtcf.speaker"] == "debug"
    assert levels()["ros.rtcf.other"] == "info"
    # And the other way round.
    master.call(f"{node}/set_logger_level", "{logger: ros.rtcf.speaker, level: error}")
    quiet_from = iteration(client)

    def heard_up_to(*markers: str) -> int:
        # A record of a hook may overtake records of the cycle that are sent at the same time.
        for name in markers:
            client.load(rtcf.component("rtcf_test_ros", "Speaker", name=name))
            wait_for(
                lambda: any(each["name"] == f"/{name}" for each in listener.records()),  # noqa: B023
                "the marker",
            )
        return sum(each["msg"] == "each cycle" for each in listener.records())

    wait_for(lambda: iteration(client) > quiet_from + 25, "cycles")
    count = heard_up_to("a", "b")
    wait_for(lambda: iteration(client) > quiet_from + 50, "more cycles")
    assert heard_up_to("c", "d") == count
    # For macros in hooks too; a parent's level applies to loggers without their own.
    master.call(f"{node}/set_logger_level", "{logger: ros.rtcf, level: debug}")
    client.load(rtcf.component("rtcf_test_ros", "Speaker", name="late"))
    wait_for(lambda: "by macro, for those who debug" in daemon.log(), "the macro's record")
    # Debian 12's log4cxx would have crashed before this point.
    assert client.get_status("rt_runner").runners[0].state == runner_pb2.RUNNER_STATE_RUNNING


def test_the_rate_limit_of_a_line_is_a_setting(
    speaking: tuple[Daemon, rtcf.Client, Node, str], master: Master
) -> None:
    daemon, client, listener, node = speaking
    assert daemon.ctl("runner", "set", "--log-limit", "2").returncode == 0
    client.load(rtcf.component("rtcf_test_ros", "Speaker", name="speaker"))
    client.start()
    master.call(f"{node}/set_logger_level", "{logger: ros.rtcf.speaker, level: debug}")

    def between() -> list[int]:
        """Return the numbers of records of the line before each count, and since the last."""
        found = [0]
        for each in listener.records():
            if "more records of this line within a second" in each["msg"]:
                found.append(0)
            elif each["msg"] == "each cycle":
                found[-1] += 1
        return found

    # A second in which the loop ran a few cycles; 50 on an idle machine.
    wait_for(lambda: any(count <= 2 for count in between()[1:-1]), "the rate limit to take effect")
    assert daemon.ctl("runner", "set", "--log-limit", "0").returncode == 0
    # All are forwarded. One count of records suppressed earlier may still arrive.
    seconds = len(between())
    wait_for(lambda: between()[-1] > 120, "every record")
    assert len(between()) <= seconds + 1


def test_levels_of_a_rosconsole_config_file_are_honoured(tmp_path: Path, master: Master) -> None:
    config = tmp_path / "rosconsole.conf"
    config.write_text(
        "# levels\nlog4j.logger.ros=INFO\nlog4j.logger.ros.rtcf.speaker=DEBUG\n"
        "log4j.logger.ros.rtcf.other=LOUD\n"
    )
    daemon = Daemon(
        tmp_path,
        with_ros(master.uri, ""),
        environment={"ROSCONSOLE_CONFIG_FILE": str(config)},
    )
    daemon.start()
    try:
        with rtcf.Client(daemon.socket) as client:
            client.load(rtcf.component("rtcf_test_ros", "Speaker", name="speaker"))
            wait_for(lambda: "by macro, for those who debug" in daemon.log(), "the record")
            logged(daemon, f"{config}:4: 'LOUD' is not a level")
    finally:
        daemon.end()

"""A loop at 2 kHz with masters that end and start: everything is registered again."""

import time
from pathlib import Path

import pytest
import rtcf
from daemon_process import DEADLINE_S, Daemon, wait_for, with_ros
from ros_processes import Master
from rtcf.v1 import runner_pb2
from values import iteration, port_value, wait_until_after

FREQUENCY_HZ = 2000.0


def _registered(master: Master, node: str) -> bool:
    published, subscribed = master.topics()
    topics = {"/t/said", "/t/age", "/answer", "/rosout", "/k/knobs/parameter_updates",
              "/k/knobs/parameter_descriptions"}  # fmt: skip
    services = {f"{node}/get_loggers", f"{node}/set_logger_level", "/k/knobs/set_parameters"}
    return (
        topics <= published
        and {"/t/heard", "/voice"} <= subscribed
        and services <= master.services()
        and master.parameter("/k/knobs/rate") == 2.5
    )


# The second case is for an otherwise idle machine.
@pytest.mark.parametrize(
    ("restarts", "limit_s"), [(2, DEADLINE_S), pytest.param(20, 2.0, marks=pytest.mark.long)]
)
def test_everything_is_registered_again_with_each_new_master(
    tmp_path: Path, restarts: int, limit_s: float
) -> None:
    master = Master(tmp_path)
    master.start()
    daemon = Daemon(tmp_path, with_ros(master.uri, "/t/.*"))
    daemon.start()
    try:
        with rtcf.Client(daemon.socket) as client:
            client.set_runner(runner_pb2.RunnerSettings(frequency_hz=FREQUENCY_HZ))
            client.load(rtcf.component("rtcf_test_ros", "Text", name="text", ns="/t"))
            client.load(
                rtcf.component(
                    "rtcf_test", "Knobs", name="knobs", ns="/k", parameters=["rate:=2.5"]
                )
            )
            client.load(
                rtcf.component(
                    "rtcf_test_ros",
                    "RosUser",
                    name="user",
                    remaps=["ear:=/voice", "~said:=/answer"],
                )
            )
            client.start()
            node = client.get_status("rt_runner").runners[0].ros.node
            wait_for(lambda: _registered(master, node), "the first registration")
            for restart in range(restarts):
                master.end()
                wait_until_after(client, iteration(client) + 500)
                master.start()
                begin = time.monotonic()
                wait_for(lambda: _registered(master, node), "the registrations", limit_s)
                print(f"restart {restart}: registered in {time.monotonic() - begin:.2f} s")
            # The registrations work: values flow to and from peers of the latest master.
            sender = master.node("text", "/t/heard", "12")
            wait_for(lambda: port_value(client, "/t/text", "length") == 12, "a message")
            sender.end()
            voice = master.node("latch", "/voice", "4.5")
            wait_for(lambda: port_value(client, "/user", "heard") == 4.5, "a call back")
            voice.end()
            dynparam = ("rosrun", "dynamic_reconfigure", "dynparam", "set", "/k/knobs", "rate", "3")
            master.run(*dynparam)
            wait_for(lambda: port_value(client, "/k/knobs", "product") == 6.0, "the parameter")
            status = client.get_status("rt_runner").runners[0]
            assert status.state == runner_pb2.RUNNER_STATE_RUNNING
            client.unload(["/user"])
    finally:
        daemon.end()
        master.end()


def test_loops_at_several_masters_are_independent(tmp_path: Path) -> None:
    masters = []
    daemons = []
    try:
        for index in range(2):
            folder = tmp_path / str(index)
            folder.mkdir()
            masters.append(Master(folder))
            masters[-1].start()
            daemons.append(Daemon(folder, with_ros(masters[-1].uri, "/t/.*")))
            daemons[-1].start()
        for index, daemon in enumerate(daemons):
            with rtcf.Client(daemon.socket) as client:
                client.load(
                    rtcf.component(
                        "rtcf_test_ros",
                        "Text",
                        name="text",
                        ns="/t",
                        parameters=[f"size:={index + 5}"],
                    )
                )
                client.start()
        # With the same names, each at its own master.
        for index, master in enumerate(masters):
            listener = master.node("sizes", "/t/said")
            listener.wait_for_values(3)
            assert set(listener.values()) == {index + 5.0}
            listener.end()
    finally:
        for daemon in daemons:
            daemon.end()
        for master in masters:
            master.end()

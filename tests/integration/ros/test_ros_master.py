"""rtcfd without a ROS master, and with one that starts later."""

import time
from pathlib import Path

import fig_1
import rtcf
from daemon_process import Daemon, wait_for, with_ros
from ros_processes import Master
from rtcf.v1 import runner_pb2
from values import iteration


def test_topics_appear_once_a_master_is_there(tmp_path: Path) -> None:
    master = Master(tmp_path)
    daemon = Daemon(tmp_path, with_ros(master.uri, fig_1.WHITELIST))
    daemon.start()
    try:
        with rtcf.Client(daemon.socket) as client:
            fig_1.load(client)
            client.start()
            wait_for(lambda: iteration(client) > 100, "a running loop without a master")
            wait_for(lambda: master.uri in _ros(client).problem, "the node to look for a master")
            ros = _ros(client)
            assert (ros.connected, ros.publications, ros.subscriptions) == (False, 0, 0)

            master.start()
            begin = time.monotonic()
            try:
                _wait_for_topics(master)
                seconds = time.monotonic() - begin
                # For information only, not a limit: the machine may be busy.
                print(f"topics {seconds:.2f} s after the master began to answer")
                wait_for(lambda: _ros(client).connected, "the status to say so")
                node = master.node("record", "/R1_H1R2")
                node.wait_until_connected()
                node.wait_for_values(100)
                node.end()
            finally:
                master.end()

            status = client.get_status("rt_runner").runners[0]
            assert status.state == runner_pb2.RUNNER_STATE_RUNNING
            wait_for(lambda: iteration(client) > status.iteration + 100, "the loop to continue")
    finally:
        daemon.end()


def _ros(client: rtcf.Client) -> runner_pb2.RosStatus:
    ros: runner_pb2.RosStatus = client.get_status("rt_runner").runners[0].ros
    return ros


def _wait_for_topics(master: Master) -> None:
    def there() -> bool:
        published, subscribed = master.topics()
        return {"/R3_G2H1", "/R1_H1R2"} <= published and "/G2_R2" in subscribed

    wait_for(there, "the topics of the loop")
    published, subscribed = master.topics()
    # Names outside the whitelist stay internal.
    assert not {"/H1_F1", "/F1_R2R3", "/R2_R3"} & (published | subscribed)
    # An input with a writer in the loop does not subscribe.
    assert not {"/R3_G2H1", "/R1_H1R2"} & subscribed

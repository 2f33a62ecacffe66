"""What rtcfd takes an executor's word for: who it is, and who has changed what."""

import os
import signal

import pytest
import rtcf
from daemon_under_test import DaemonUnderTest, wait_for


def test_a_stranger_at_an_executors_socket_is_not_taken_for_it(
    stopped_daemon: DaemonUnderTest,
) -> None:
    real = stopped_daemon.executor.with_name("real")
    stopped_daemon.executor.rename(real)
    pid_file = stopped_daemon.folder / "pid"
    # Another process, of a session of its own, serves; what was started does not.
    stopped_daemon.executor.write_text(
        f'#!/bin/sh\n[ "$1" = --describe ] && exec {real} "$@"\n'
        f'setsid sh -c \'echo $$ > {pid_file}; exec {real} "$@"\' sh "$@" &\n'
        "exec sleep 60\n"
    )
    stopped_daemon.executor.chmod(0o755)
    daemon = stopped_daemon.start()
    wait_for(pid_file.exists, "the stranger")
    try:
        refused = pytest.raises(rtcf.RefusedError, match="which is not the executor of rt_runner")
        with daemon.client() as client, refused:
            client.start()
    finally:
        os.kill(int(pid_file.read_text()), signal.SIGKILL)


def test_an_executor_of_another_runner_is_not_taken_for_ours(
    stopped_daemon: DaemonUnderTest,
) -> None:
    real = stopped_daemon.executor.with_name("real")
    stopped_daemon.executor.rename(real)
    stopped_daemon.executor.write_text(
        f'#!/bin/sh\n[ "$1" = --runner ] && {{ shift 2; exec {real} --runner other "$@"; }}\n'
        f'exec {real} "$@"\n'
    )
    stopped_daemon.executor.chmod(0o755)
    daemon = stopped_daemon.start()
    refused = pytest.raises(rtcf.RefusedError, match='served by the executor of runner "other"')
    with daemon.client() as client, refused:
        client.start()


def test_who_has_set_a_parameter_to_what_is_in_the_log(daemon: DaemonUnderTest) -> None:
    with daemon.client() as client:
        client.load(rtcf.component("demo", "Fine", name="x"))
        client.set_parameters("x", [rtcf.parse_parameter("kp:=2.5")])
    wait_for(lambda: "/x: kp = 2.5 set by root" in daemon.log(), "the log")

"""Log records of components through rtcfd: in order, with cycle numbers, losses counted."""

import json
import re
import signal
import subprocess
from collections.abc import Callable

import pytest
import rtcf
from daemon_process import BUILD_TREE, Daemon, clean_environment, wait_for
from rtcf.streams.numbered import Lost, NumberedStream, Place
from rtcf.v1 import control_pb2, runner_pb2

Record = control_pb2.LogRecord
KEPT = 4096


def until(
    stream: NumberedStream[control_pb2.LogRecord],
    condition: Callable[[control_pb2.LogRecord], bool],
) -> control_pb2.LogRecord:
    """Return the first record that fulfils a condition; fails if the daemon ends."""
    for record in stream:
        assert not isinstance(record, Lost)
        if condition(record):
            return record
    raise AssertionError("the stream ended")


def kept(client: rtcf.Client, *components: str, level: str = "debug") -> list[str]:
    """Return all stored messages."""
    with client.watch_logs("", components, level, Place(), until_now=True) as stream:
        return [each.message for each in stream if isinstance(each, Record)]


def test_records_have_the_cycle_in_which_they_were_logged(
    running: Daemon, client: rtcf.Client
) -> None:
    with client.watch_logs(components=["wave"]) as stream:
        record = until(stream, lambda each: "through zero" in each.message)
        later = until(stream, lambda each: "through zero" in each.message)
    assert record.message.endswith(f" in cycle {record.iteration}")
    assert (record.component, record.level) == ("/wave", Record.LEVEL_INFO)
    assert record.file.endswith("wave.cpp") and record.line > 0
    assert later.sequence > record.sequence and later.iteration > record.iteration
    assert later.time_ns > record.time_ns


def test_earlier_records_are_kept_and_a_returning_client_misses_none(
    client: rtcf.Client,
) -> None:
    with client.watch_logs() as stream:
        place = stream.place
    client.load(rtcf.component("rtcf_examples", "Wave", name="a"))
    client.load(rtcf.component("rtcf_examples", "Wave", name="b"))
    configured = "configured: amplitude 1, rate 1 Hz"

    def all_there() -> list[tuple[str, str]]:
        with client.watch_logs(after=place, until_now=True) as stream:
            found = [each for each in stream if isinstance(each, Record)]
        return [(each.component, each.message) for each in found if each.component]

    assert wait_for(lambda: len(all_there()) == 2 and all_there(), "both records") == [
        ("/a", configured),
        ("/b", configured),
    ]
    assert kept(client, "b") == [configured]
    client.unload(["b"])
    assert kept(client, "/b") == [configured]


def test_only_records_of_the_requested_level_are_sent(client: rtcf.Client) -> None:
    loud = rtcf.component("rtcf_examples", "Wave", name="loud", parameters=["amplitude:=9.5"])
    client.load(loud)
    with client.watch_logs(level="warn") as stream:
        client.start()
        record = until(stream, lambda each: each.component == "/loud")
    assert (record.message, record.level) == ("amplitude 9.5 is large", Record.LEVEL_WARN)
    assert kept(client, "loud", level="error") == []
    assert "started" in kept(client, "loud", level="info")
    levels = "debug, info, warn, error, fatal"
    with pytest.raises(ValueError, match=f'level "loud": must be one of {levels}'):
        client.watch_logs(level="loud")


def test_records_no_longer_stored_are_counted(client: rtcf.Client) -> None:
    client.set_runner(runner_pb2.RunnerSettings(frequency_hz=1.0))
    client.load(rtcf.component("rtcf_examples", "Wave", name="wave", parameters=["rate:=0.4"]))

    def enough() -> bool:
        client.step(500)
        with client.watch_logs(until_now=True) as stream:
            return stream.place.sequence > KEPT + 100

    wait_for(enough, "more records than are kept")
    with client.watch_logs(after=Place(), until_now=True) as stream:
        first, *rest = stream
    assert isinstance(first, Lost) and first.count > 100
    assert len(rest) == KEPT
    numbers = [each.sequence for each in rest if isinstance(each, Record)]
    assert numbers == list(range(first.count + 1, first.count + KEPT + 1))


def test_logs_are_printed_as_text_and_json(daemon: Daemon, client: rtcf.Client) -> None:
    client.load(rtcf.component("rtcf_examples", "Wave", name="wave"))
    client.start()
    client.stop()
    wait_for(lambda: "stopped" in kept(client, "wave"), "the last record")
    done = daemon.ctl("logs", "wave", "-n", "1")
    assert done.returncode == 0, done.stderr
    date = r"\d{4}-\d\d-\d\d \d\d:\d\d:\d\d\.\d{3}"
    assert re.fullmatch(rf"{date} info  /wave #\d+: stopped\n", done.stdout), done.stdout
    lines = daemon.ctl("logs", "wave", "-o", "json", "--level", "info").stdout.splitlines()
    documents = [json.loads(line) for line in lines]
    assert [each["message"] for each in documents if "zero" not in each["message"]] == [
        "configured: amplitude 1, rate 1 Hz", "started", "stopped",
    ]  # fmt: skip
    assert {(each["component"], each["level"]) for each in documents} == {("/wave", "info")}


def test_following_continues_until_ctrl_c(daemon: Daemon, client: rtcf.Client) -> None:
    client.load(rtcf.component("rtcf_examples", "Wave", name="wave"))
    process = subprocess.Popen(
        [BUILD_TREE / "bin" / "rtcfctl", "--socket", daemon.socket, "logs", "wave",
         "-f", "-o", "json"],
        stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, env=clean_environment(),
    )  # fmt: skip
    assert process.stdout is not None
    assert "configured" in json.loads(process.stdout.readline())["message"]
    client.start()
    assert json.loads(process.stdout.readline())["message"] == "started"
    process.send_signal(signal.SIGINT)
    _, said = process.communicate()
    assert (process.returncode, said) == (0, "")


@pytest.mark.parametrize(
    ("words", "code", "said"),
    [
        (("logs", "wav"), 1, "no component /wav in runner rt_runner, and no log record of one; "
         'did you mean "/wave"? (components: /mimo, /wave)'),
        (("logs", "--level", "loud"), 2, "invalid choice: 'loud'"),
        (("logs", "-n", "-1"), 2, "-1: use a whole number from 0"),
        (("-r", "nobody", "logs"), 1, 'no runner "nobody" (runners: rt_runner)'),
    ],
)  # fmt: skip
def test_errors_are_one_line(running: Daemon, words: tuple[str, ...], code: int, said: str) -> None:
    done = running.ctl(*words)
    assert done.returncode == code
    assert said in done.stderr.splitlines()[-1]


def test_a_watcher_is_told_when_its_runner_is_removed(client: rtcf.Client) -> None:
    client.add_runner("arm")
    with client.watch_logs("arm") as stream:
        client.remove_runner("arm")
        with pytest.raises(rtcf.RefusedError, match="runner arm no longer exists"):
            list(stream)

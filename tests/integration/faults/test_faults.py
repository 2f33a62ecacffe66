"""Each fault, caused by a real component: its report, and what continues to run."""

import contextlib
import os
import re
import signal
import time
from collections.abc import Iterator

import pytest
import rtcf
from bystander import Bystander
from daemon_process import Daemon, wait_for
from pages import TREE
from rtcf import reasons
from rtcf.v1 import graph_pb2, runner_pb2
from values import port_value, state

SETTINGS = "[runner]\nstall_timeout_ms = 300\n[runner.ros]\nenabled = false\n"


@pytest.fixture
def settings() -> str:
    """Return the settings of an rtcfd with a short stall timeout."""
    return SETTINGS


@pytest.fixture(autouse=True)
def bystander(client: rtcf.Client) -> Iterator[Bystander]:
    """Run a second loop all the time; it must not notice any fault."""
    bystander = Bystander(client)
    yield bystander
    bystander.check()


def faulty(type_name: str, *, optional: bool = False, after: int = 20) -> graph_pb2.ComponentSpec:
    return rtcf.component(
        "rtcf_faults", type_name, name="bad", optional=optional, parameters=[f"after:={after}"]
    )


def load(client: rtcf.Client, bad: graph_pb2.ComponentSpec) -> None:
    """Load a faulty component and, around it in the order, two healthy ones."""
    client.load(rtcf.component("rtcf_test", "Counter", name="a", remaps=["out:=/a"]))
    client.load(bad)
    client.load(rtcf.component("rtcf_test", "Counter", name="z", remaps=["in:=/a", "out:=/z"]))


CRASHES = {
    "NullDereference": r"was killed by SIGSEGV \(.*\) at address 0x0 while /bad\.update",
    "DivisionByZero": r"was killed by SIGFPE \(.*\) at address 0x[0-9a-f]+ while /bad\.update",
    "StackOverflow": r"was killed by SIGSEGV \(.*\) at address 0x[0-9a-f]+ while /bad\.update",
    "CallsAbort": r"was killed by SIGABRT \(.*\) while /bad\.update",
    "ThrowsThroughNoexcept": r"was killed by SIGABRT \(.*\) while /bad\.update",
    "CallsExit": r"ended with exit status 3 while /bad\.update",
    "NeverReturns": r"was ended because a cycle made no progress while /bad\.update",
}


@pytest.mark.parametrize("type_name", CRASHES)
def test_a_component_that_crashes_is_named_and_taken_out(
    daemon: Daemon, client: rtcf.Client, type_name: str
) -> None:
    load(client, faulty(type_name))
    with contextlib.suppress(reasons.ExecutorDownError):  # it may die before it answers
        client.start()
    wait_for(lambda: "executor restarted in" in daemon.log(), "the recovery")
    status = state(client)
    assert re.search(CRASHES[type_name], status.status), status.status
    assert re.search(r"in cycle \d+", status.status)
    assert status.state == runner_pb2.RUNNER_STATE_FAULTED
    assert client.get_order() == ["/a", "/z"]
    assert client.get_component("bad").state == graph_pb2.COMPONENT_STATE_LEFT_OUT
    # Without the culprit it runs if a user accepts that explicitly.
    with pytest.raises(reasons.ComponentLeftOutError, match=r"left out of its loop: /bad \("):
        client.start()
    client.start(without=["bad"])
    wait_for(lambda: state(client).iteration > 100, "100 cycles")


# With the content of the line that crashes.
PLACES = {
    "NullDereference": ("NullDereference::fault", "*nowhere = 1;"),
    "DivisionByZero": ("DivisionByZero::fault", "zero = 7 / zero;"),
    "CallsAbort": ("CallsAbort::fault", "std::abort();"),
    "StackOverflow": ("StackOverflow::deeper", None),
}


@pytest.mark.parametrize("type_name", PLACES)
def test_a_crash_is_named_with_its_source_line(
    daemon: Daemon, client: rtcf.Client, type_name: str
) -> None:
    function, code = PLACES[type_name]
    load(client, faulty(type_name))
    client.start()
    wait_for(lambda: "it crashed in" in daemon.log(), "the place")
    (line,) = [each for each in daemon.log().splitlines() if "it crashed in" in each]
    found = re.search(r"it crashed in .*?([^: ]+::[^: ]+)\(.*?\) at (\S+):(\d+) \(innermost", line)
    assert found, line
    assert (found[1], found[2]) == (function, "crashes.cpp")
    if code is not None:
        source = TREE / "tests" / "components" / "faults" / "crashes.cpp"
        assert code in source.read_text().splitlines()[int(found[3]) - 1]
    else:
        assert line.count("deeper at crashes.cpp:") > 2, "its callers are listed"
    assert "rtcf-executor" not in line
    wait_for(lambda: "crashes.cpp:" in state(client).status, "the status")
    assert client.get_component("bad").fault.endswith(f"at crashes.cpp:{found[3]}")
    # The source line outlives rtcfd with the rest of the reason.
    wait_for(lambda: "crashes.cpp:" in saved(daemon), "the state on disk")


def saved(daemon: Daemon) -> str:
    return (daemon.folder / "state" / "rt_runner.json").read_text()


@pytest.mark.parametrize("type_name", ["NullDereference", "CallsAbort"])
def test_a_component_that_crashes_a_step_is_named_and_taken_out(
    daemon: Daemon, client: rtcf.Client, type_name: str
) -> None:
    load(client, faulty(type_name))
    with pytest.raises(rtcf.RefusedError, match=CRASHES[type_name]):
        client.step(100)
    wait_for(lambda: "executor restarted in" in daemon.log(), "the recovery")
    assert re.search(rf"{CRASHES[type_name]} was running in cycle \d+", state(client).status)
    assert client.get_order() == ["/a", "/z"]
    client.step(100)


def _stop_in_vain(daemon: Daemon, client: rtcf.Client, faulty: str) -> str:
    """Stop a loop whose safe() ends its executor: the answer names it; return the log."""
    client.load(rtcf.component("rtcf_faults", faulty, name="bad"))
    client.start()
    wait_for(lambda: state(client).iteration > 20, "20 cycles")
    with pytest.raises(rtcf.RefusedError, match=r"/bad\.safe"):
        client.stop()
    wait_for(lambda: "executor restarted in" in daemon.log(), "the recovery")
    return daemon.log()


def test_a_safe_hook_that_hangs_is_named(daemon: Daemon, client: rtcf.Client) -> None:
    log = _stop_in_vain(daemon, client, "HangsInSafe")
    assert "because a cycle made no progress while /bad.safe was running" in log


def test_a_safe_hook_that_crashes_is_named(daemon: Daemon, client: rtcf.Client) -> None:
    log = _stop_in_vain(daemon, client, "CrashesInSafe")
    assert re.search(r"killed by SIGABRT \(.*\) while /bad\.safe was running", log)


def test_a_take_over_that_hangs_is_named(daemon: Daemon, client: rtcf.Client) -> None:
    client.load(rtcf.component("rtcf_test", "Counter", name="bad"))
    client.start()
    wait_for(lambda: state(client).iteration > 20, "20 cycles")
    with pytest.raises(rtcf.RefusedError, match=r"/bad\.takeOver"):
        client.replace("bad", rtcf.component("rtcf_faults", "HangsInTakeOver"))
    wait_for(lambda: "executor restarted in" in daemon.log(), "the recovery")
    assert "because a cycle made no progress while /bad.takeOver was running" in daemon.log()


def test_a_take_over_that_crashes_is_named(daemon: Daemon, client: rtcf.Client) -> None:
    client.load(rtcf.component("rtcf_test", "Counter", name="bad"))
    client.start()
    wait_for(lambda: state(client).iteration > 20, "20 cycles")
    crash = r"killed by SIGABRT \(.*\) while /bad\.takeOver was running"
    with pytest.raises(rtcf.RefusedError, match=crash):
        client.replace("bad", rtcf.component("rtcf_faults", "CrashesInTakeOver"))
    wait_for(lambda: "executor restarted in" in daemon.log(), "the recovery")
    assert re.search(crash, daemon.log())


def test_a_device_whose_wait_hangs_is_named(daemon: Daemon, client: rtcf.Client) -> None:
    client.load(rtcf.component("rtcf_faults", "HangsInWait", name="bad"))
    client.start()
    wait_for(lambda: "executor restarted in" in daemon.log(), "the recovery")
    assert "because a cycle made no progress while /bad.wait was running" in daemon.log()


def test_a_device_whose_wait_crashes_is_named(daemon: Daemon, client: rtcf.Client) -> None:
    client.load(rtcf.component("rtcf_faults", "CrashesInWait", name="bad"))
    # It may crash before the answer to the start.
    with contextlib.suppress(rtcf.RefusedError):
        client.start()
    wait_for(lambda: "executor restarted in" in daemon.log(), "the recovery")
    crash = r"killed by SIGABRT \(.*\) while /bad\.wait was running"
    assert re.search(crash, state(client).status), state(client).status
    assert re.search(crash, daemon.log())
    assert client.get_order() == []


def test_a_polled_device_may_be_silent_for_long(client: rtcf.Client) -> None:
    client.set_runner(runner_pb2.RunnerSettings(cpu=-1))
    client.load(rtcf.component("rtcf_faults", "PollsSilence", name="bad"))
    client.start()
    pid = state(client).pid
    # Longer than the stall timeout and the kernel's limit after it, including the
    # kernel's signals at that limit.
    for _ in range(3):
        time.sleep(1.0)
        os.kill(pid, signal.SIGXCPU)
    assert state(client).state == runner_pb2.RUNNER_STATE_RUNNING
    client.stop()
    assert state(client).pid == pid


def test_a_stopped_process_is_not_reported_as_stalled(client: rtcf.Client) -> None:
    client.load(faulty("Lingers", after=0))
    client.set_runner(runner_pb2.RunnerSettings(frequency_hz=5.0))
    client.start()
    wait_for(lambda: state(client).iteration > 2, "2 cycles")
    pid = state(client).pid
    for _ in range(3):
        os.kill(pid, signal.SIGSTOP)
        time.sleep(0.7)
        os.kill(pid, signal.SIGCONT)
        before = state(client).iteration
        wait_for(lambda: state(client).iteration > before + 1, "the next cycle")  # noqa: B023
    assert state(client).pid == pid


def test_heap_corruption_names_the_running_component_or_none(
    daemon: Daemon, client: rtcf.Client
) -> None:
    load(client, faulty("HeapCorruption"))
    client.start()
    wait_for(lambda: "executor restarted in" in daemon.log(), "the recovery")
    assert client.get_order() in (["/a", "/z"], ["/a", "/bad", "/z"])
    assert state(client).state == runner_pb2.RUNNER_STATE_FAULTED


def test_a_crashing_hook_fails_the_change(daemon: Daemon, client: rtcf.Client) -> None:
    load(client, faulty("Sleeps"))
    with pytest.raises(
        rtcf.RefusedError, match=r"SIGSEGV .* while /CrashingConfigure\.configure was running"
    ):
        client.load(rtcf.component("rtcf_faults", "CrashingConfigure"))
    wait_for(lambda: "executor restarted in" in daemon.log(), "the recovery")
    assert client.get_order() == ["/a", "/bad", "/z"]


def test_a_component_with_a_crashing_stop_hook_is_taken_out(
    daemon: Daemon, client: rtcf.Client
) -> None:
    load(client, rtcf.component("rtcf_faults", "CrashingStop", name="bad"))
    client.start()
    with pytest.raises(rtcf.RefusedError):
        client.stop()
    wait_for(lambda: "executor restarted in" in daemon.log(), "the recovery")
    assert "while /bad.stop was running" in daemon.log()
    assert client.get_order() == ["/a", "/z"]


def test_a_loop_continues_without_a_crashed_optional_component(
    daemon: Daemon, client: rtcf.Client
) -> None:
    client.set_runner(runner_pb2.RunnerSettings(on_crash=runner_pb2.ON_CRASH_RESUME))
    load(client, faulty("NullDereference", optional=True))
    client.start()
    wait_for(lambda: "executor restarted in" in daemon.log(), "the recovery")
    assert client.get_order() == ["/a", "/z"]
    assert state(client).state == runner_pb2.RUNNER_STATE_RUNNING
    wait_for(lambda: state(client).iteration > 100, "100 cycles")


def test_an_exception_stops_the_loop_in_order(daemon: Daemon, client: rtcf.Client) -> None:
    load(client, faulty("Throws"))
    client.start()
    wait_for(lambda: state(client).state == runner_pb2.RUNNER_STATE_FAULTED, "the fault")
    assert "/bad: update() threw: the encoder jumped" in state(client).status
    assert client.get_component("bad").state == graph_pb2.COMPONENT_STATE_FAULTED
    assert client.get_order() == ["/a", "/bad", "/z"]
    wait_for(lambda: "the encoder jumped" in daemon.log(), "the log")


def test_an_exception_of_an_optional_component_takes_it_out(
    daemon: Daemon, client: rtcf.Client
) -> None:
    load(client, faulty("Throws", optional=True))
    client.start()
    wait_for(lambda: client.get_component("bad").fault, "the fault")
    before = state(client)
    assert before.state == runner_pb2.RUNNER_STATE_RUNNING
    wait_for(lambda: state(client).iteration > before.iteration + 100, "100 cycles")


def test_a_taken_out_component_is_released_with_its_parameters(client: rtcf.Client) -> None:
    load(client, faulty("Throws", optional=True))
    client.start()
    wait_for(lambda: client.get_component("bad").fault, "the fault")
    client.set_parameters("bad", [rtcf.parse_parameter("after:=1000000")])
    before = state(client)
    client.release(["bad"])
    found = client.get_component("bad")
    assert (found.state, found.fault) == (graph_pb2.COMPONENT_STATE_RUNNING, "")
    (after,) = (each for each in found.parameters if each.name == "after")
    assert after.value.int_value == 1000000
    wait_for(lambda: state(client).iteration > before.iteration + 100, "100 cycles")
    assert port_value(client, "bad", "out") > 0, "the component is updated again"
    assert state(client).pid == before.pid
    with pytest.raises(reasons.ComponentNotLeftOutError, match="it is in the loop"):
        client.release(["bad"])


def test_left_out_and_taken_out_components_are_released_together(
    daemon: Daemon, client: rtcf.Client
) -> None:
    load(client, faulty("NullDereference"))
    client.start()
    wait_for(lambda: "executor restarted in" in daemon.log(), "the recovery")
    client.load(
        rtcf.component(
            "rtcf_faults", "Throws", name="loose", optional=True, parameters=["after:=0"]
        )
    )
    client.start(partial=True)
    wait_for(lambda: client.get_component("loose").fault, "the fault")
    for name in ("bad", "loose"):
        client.set_parameters(name, [rtcf.parse_parameter("after:=1000000")])
    client.release(["bad", "loose"])
    assert not [each.full_name for each in client.list_components() if each.fault]
    assert set(client.get_order()) == {"/a", "/bad", "/loose", "/z"}


def test_a_parameter_of_a_left_out_component_can_be_corrected(
    daemon: Daemon, client: rtcf.Client
) -> None:
    load(client, faulty("NullDereference"))
    client.start()
    wait_for(lambda: "executor restarted in" in daemon.log(), "the recovery")
    result = client.set_parameters("bad", [rtcf.parse_parameter("after:=1000000")])
    assert "/bad is left out of the loop" in result.notes[0]
    for wrong, what in (
        ("after:=-1", "is below its minimum 0"),
        ("after:=text", "takes an int, not a string"),
        ("befor:=1", "has no parameter befor"),
    ):
        with pytest.raises(rtcf.RefusedError, match=what):
            client.set_parameters("bad", [rtcf.parse_parameter(wrong)])
    assert [each.value.int_value for each in client.get_history("bad", "after")] == [20, 1000000]
    client.set_parameters("bad", [rtcf.parse_parameter("after:=3")])
    assert client.undo_parameters("bad").notes[-1].startswith("after = 1000000")
    client.release(["bad"])
    client.start()
    wait_for(lambda: state(client).iteration > 100, "100 cycles")
    assert client.get_component("bad").state == graph_pb2.COMPONENT_STATE_RUNNING


def test_a_start_names_left_out_components(daemon: Daemon, client: rtcf.Client) -> None:
    load(client, faulty("NullDereference"))
    client.start()
    wait_for(lambda: "executor restarted in" in daemon.log(), "the recovery")
    done = daemon.ctl("start")
    assert done.returncode == 1
    assert re.search(r"left out of its loop: /bad \(.* start --without /bad`", done.stderr)
    assert len(done.stderr.splitlines()) == 1
    done = daemon.ctl("start", "--without", "good")
    assert done.returncode == 1
    assert "/good is not left out of runner rt_runner (left out: /bad)" in done.stderr
    done = daemon.ctl("start", "--without", "bad")
    assert (done.returncode, done.stdout) == (0, "started\n"), done.stderr
    assert "rtcfctl: note: without /bad: was killed by SIGSEGV" in done.stderr
    # A running loop is left alone, even if components are missing.
    assert daemon.ctl("start").returncode == 0
    client.stop()
    assert daemon.ctl("start", "--partial").returncode == 0


def test_a_left_out_optional_component_blocks_no_start(daemon: Daemon, client: rtcf.Client) -> None:
    load(client, faulty("NullDereference", optional=True))
    client.start()
    wait_for(lambda: "executor restarted in" in daemon.log(), "the recovery")
    assert client.start().notes[-1].startswith("without /bad: was killed by SIGSEGV")


def test_a_non_finite_value_is_held_back(daemon: Daemon, client: rtcf.Client) -> None:
    load(client, faulty("NotFinite"))
    client.start()
    fault = wait_for(lambda: client.get_component("bad").fault, "the fault")
    assert "is not finite" in fault
    assert state(client).state == runner_pb2.RUNNER_STATE_RUNNING


@pytest.mark.parametrize(
    ("type_name", "told"),
    [("NotFinite", "is not finite: readers keep its last value"),
     ("Reports", "the sensor is dead")],
)  # fmt: skip
def test_faults_beyond_the_reported_ones_are_counted(
    daemon: Daemon, client: rtcf.Client, type_name: str, told: str
) -> None:
    load(client, faulty(type_name))
    client.start()
    wait_for(lambda: client.get_component("bad").faults > 20, "the faults")
    # Reported once, and counted in every view.
    wait_for(lambda: told in daemon.log(), "the log")
    assert daemon.log().count(told) == 1
    assert re.search(rf"{told}.* \(\d+ in all\)", daemon.ctl("list").stdout)
    assert re.search(r"fault: .* \(\d+ in all\)", daemon.ctl("info", "bad").stdout)
    assert re.search(r"rt_runner: \d+ faults of components", daemon.ctl("status").stdout)
    assert re.search(r"^/bad: \d+ faults$", daemon.ctl("stats").stdout, re.MULTILINE)
    assert state(client).faults >= 20
    client.stop()
    # Each run of the loop counts from zero.
    client.set_runner(runner_pb2.RunnerSettings(frequency_hz=1.0))
    client.start()
    assert client.get_component("bad").faults < 20


def test_a_non_finite_value_stops_the_loop_if_requested(
    daemon: Daemon, client: rtcf.Client
) -> None:
    load(client, faulty("NotFiniteStops"))
    client.start()
    wait_for(lambda: state(client).state == runner_pb2.RUNNER_STATE_FAULTED, "the fault")
    assert "is not finite" in state(client).status


@pytest.mark.parametrize("type_name", ["Allocates", "Sleeps"])
def test_a_slow_component_shows_in_the_statistics(
    daemon: Daemon, client: rtcf.Client, type_name: str
) -> None:
    load(client, faulty(type_name, after=0))
    client.start()

    def longest() -> tuple[float, float]:
        durations = {each.component: each.duration for each in client.get_statistics().components}
        return durations["/bad"].p50_ns, durations["/a"].p50_ns

    wait_for(lambda: longest()[0] > 5e4 > longest()[1] > 0, "the statistics")


def safe_calls(daemon: Daemon) -> int:
    return daemon.log().count("hook safe")


@pytest.mark.parametrize("end", ["Throws", "NotFiniteStops", "overruns", "stop"])
def test_each_orderly_end_calls_safe_once_per_component(
    daemon: Daemon, client: rtcf.Client, end: str
) -> None:
    client.load(rtcf.component("rtcf_test", "Witness", name="first"))
    if end in ("Throws", "NotFiniteStops"):
        client.load(faulty(end))
    elif end == "overruns":
        client.set_runner(runner_pb2.RunnerSettings(frequency_hz=20000.0, max_overruns=10))
        client.load(faulty("Sleeps"))
    client.load(rtcf.component("rtcf_test", "Witness", name="second"))
    client.start()
    # Without real-time rights a loop is not blamed for being late.
    spared = end == "overruns" and bool(state(client).degraded)
    if end == "stop" or spared:
        wait_for(lambda: state(client).iteration > 100, "more cycles than overruns are allowed")
        client.stop()
    else:
        wait_for(lambda: state(client).state == runner_pb2.RUNNER_STATE_FAULTED, "its end")
    wait_for(lambda: daemon.log().count("hook stop") == 2, "the stop hooks")
    # Failed components, too.
    assert safe_calls(daemon) == (3 if end in ("Throws", "NotFiniteStops") else 2)
    if spared:
        wait_for(lambda: "; max_overruns does not stop a degraded loop" in daemon.log(), "the log")
    elif end == "overruns":
        assert re.search(
            r"loop stopped in iteration \d+: more than 10 overruns", state(client).status
        )
        wait_for(lambda: "ended late" in daemon.log(), "the log")


def test_a_crash_calls_no_safe_hook(daemon: Daemon, client: rtcf.Client) -> None:
    client.load(rtcf.component("rtcf_test", "Witness"))
    client.load(faulty("NullDereference"))
    client.start()
    wait_for(lambda: "executor restarted in" in daemon.log(), "the recovery")
    assert safe_calls(daemon) == 0


def test_a_crash_is_recovered_within_a_second(daemon: Daemon, client: rtcf.Client) -> None:
    load(client, faulty("NullDereference"))
    client.start()
    wait_for(lambda: "executor restarted in" in daemon.log(), "the recovery")
    (took,) = re.findall(r"executor restarted in ([0-9.]+) s", daemon.log())
    print(f"restored {took} s after the death")


def give_up(daemon: Daemon, client: rtcf.Client) -> None:
    """Kill executors until rtcfd starts none any more."""
    seen = set()
    while (status := state(client)).state != runner_pb2.RUNNER_STATE_DOWN:
        if status.pid and status.pid not in seen:
            seen.add(status.pid)
            os.kill(status.pid, signal.SIGKILL)
        time.sleep(0.01)
        assert len(seen) < 20
        if "the last of" not in daemon.log():
            wait_for(
                lambda: state(client).pid not in (0, *seen) or "the last of" in daemon.log(),
                "another executor, or none any more",
            )


def test_an_executor_that_keeps_dying_is_not_restarted(daemon: Daemon, client: rtcf.Client) -> None:
    client.load(rtcf.component("rtcf_test", "Counter", name="a"))
    give_up(daemon, client)
    assert client.start().order == ["/a"]


def test_settings_of_a_runner_without_executor_are_checked(
    daemon: Daemon, client: rtcf.Client
) -> None:
    client.load(rtcf.component("rtcf_test", "Counter", name="a"))
    give_up(daemon, client)
    done = daemon.ctl("runner", "set", "--whitelist", "(")
    assert done.returncode == 1
    assert "whitelist: bad regular expression '('" in done.stderr
    assert len(done.stderr.splitlines()) == 1
    done = daemon.ctl("runner", "set", "--whitelist", "/a/.*")
    assert done.returncode == 0, done.stderr
    assert client.start().order == ["/a"]
    assert state(client).settings.ros.whitelist == "/a/.*"

"""Statistics of a loop: queried, reset and watched while it runs."""

import itertools
import json
import signal
from typing import Any

import pytest
import rtcf
from daemon_process import Daemon, wait_for
from rtcf.v1 import graph_pb2, runner_pb2
from values import iteration, port_value, state


def _slow(name: str) -> graph_pb2.ComponentSpec:
    """A component that sleeps 100 µs in each cycle."""
    return rtcf.component(
        "rtcf_faults", "Sleeps", name=name, remaps=["out:=~out"], parameters=["after:=0"]
    )


def test_each_cycle_is_counted_once_in_all_statistics(client: rtcf.Client) -> None:
    client.set_runner(runner_pb2.RunnerSettings(warmup_cycles=7))
    client.load(rtcf.component("rtcf_test", "Counter"))
    client.start()
    wait_for(lambda: iteration(client) > 200, "200 cycles")
    client.stop()
    statistics = client.get_statistics()
    cycles = iteration(client) - 7
    assert statistics.iterations == cycles
    assert statistics.duration.count == statistics.latency.count == cycles
    (counter,) = statistics.components
    assert (counter.component, counter.duration.count) == ("/Counter", cycles)
    assert 0 < counter.duration.min_ns <= counter.duration.p50_ns <= counter.duration.p99_ns
    assert counter.duration.p99_ns <= counter.duration.p999_ns <= counter.duration.max_ns


def test_a_reset_clears_the_statistics_and_affects_no_loop(client: rtcf.Client) -> None:
    client.load(rtcf.component("rtcf_test", "Counter"))
    client.start()
    wait_for(lambda: client.get_statistics().iterations > 1000, "1000 cycles")
    before = iteration(client)
    client.reset_statistics()
    statistics = client.get_statistics()
    assert statistics.iterations <= iteration(client) - before + 1
    assert statistics.components[0].duration.count <= statistics.iterations + 1
    wait_for(lambda: client.get_statistics().iterations > 100, "more cycles")
    assert client.get_status("rt_runner").runners[0].state == runner_pb2.RUNNER_STATE_RUNNING


def test_the_time_with_devices_is_counted(client: rtcf.Client) -> None:
    client.set_runner(runner_pb2.RunnerSettings(warmup_cycles=0))
    client.load(rtcf.component("rtcf_test", "Device"))
    client.load(rtcf.component("rtcf_test", "Counter"))
    client.step(20)
    statistics = {each.component: each for each in client.get_statistics().components}
    assert statistics["/Device"].device_calls == 20
    assert 0 < statistics["/Device"].device_mean_ns <= statistics["/Device"].duration.mean_ns
    assert (statistics["/Counter"].device_calls, statistics["/Counter"].device_mean_ns) == (0, 0)
    client.reset_statistics()
    client.step(3)
    (device,) = [each for each in client.get_statistics().components if each.device_calls]
    assert (device.component, device.device_calls) == ("/Device", 3)


def test_a_start_clears_the_statistics(client: rtcf.Client) -> None:
    client.load(rtcf.component("rtcf_test", "Counter"))
    for _ in range(2):
        client.start()
        wait_for(lambda: iteration(client) > 100, "100 cycles")
        client.stop()
        statistics = client.get_statistics()
        assert statistics.iterations == iteration(client) - 10  # the default warm-up


def test_overruns_are_counted_for_the_component_that_was_running(
    daemon: Daemon, client: rtcf.Client
) -> None:
    client.set_runner(runner_pb2.RunnerSettings(frequency_hz=20000.0))
    client.load(rtcf.component("rtcf_test", "Counter", name="quick"))
    client.load(_slow("slow"))
    client.start()

    def overruns() -> dict[str, int]:
        return {each.component: each.overruns for each in client.get_statistics().components}

    wait_for(lambda: overruns()["/slow"] > 100, "overruns")
    assert overruns()["/quick"] < overruns()["/slow"] / 2
    statistics = client.get_statistics()
    assert statistics.missed >= statistics.overruns - 1
    status = client.get_status("rt_runner").runners[0]
    assert status.overruns >= statistics.overruns
    # Hardly any more from here on, however long the next lines take.
    client.set_runner(runner_pb2.RunnerSettings(frequency_hz=10.0))
    client.reset_statistics()
    assert client.get_statistics().overruns < statistics.overruns


@pytest.mark.parametrize(
    "policy", [runner_pb2.OVERRUN_POLICY_SKIP, runner_pb2.OVERRUN_POLICY_CATCH_UP]
)
def test_a_reset_of_a_late_loop_affects_all_statistics_at_one_instant(
    daemon: Daemon, client: rtcf.Client, policy: runner_pb2.OverrunPolicy
) -> None:
    client.set_runner(runner_pb2.RunnerSettings(frequency_hz=20000.0, overrun=policy))
    for name in ("a", "b", "c"):
        client.load(rtcf.component("rtcf_test", "Counter", name=name, remaps=["out:=~out"]))
    client.load(_slow("slow"))
    client.start()
    for _ in range(10):
        wait_for(lambda: client.get_statistics().overruns > 20, "overruns")
        total = state(client).iteration
        assert daemon.ctl("stats", "--reset").returncode == 0
        more = state(client)
        # Negative differences would wrap to large numbers.
        assert more.overruns <= more.iteration
        assert client.get_statistics().overruns <= iteration(client)
        assert more.iteration >= total, "cycle numbers continue"
    wait_for(lambda: client.get_statistics().overruns > 20, "overruns")
    client.stop()
    status, statistics = state(client), client.get_statistics()
    assert (status.overruns, status.missed) == (statistics.overruns, statistics.missed)
    # Catching up drops cycles only after a hundred late ones in a row.
    assert statistics.missed > 0 or policy == runner_pb2.OVERRUN_POLICY_CATCH_UP
    causes = (
        statistics.late_wake_ups
        + statistics.exchange_overruns
        + statistics.frame_overruns
        + statistics.catching_up
    )
    assert causes + sum(each.overruns for each in statistics.components) == statistics.overruns
    counts = [each.duration.count for each in statistics.components]
    assert counts == [statistics.iterations] * 4
    assert 0 < statistics.overruns <= statistics.iterations == statistics.latency.count


def test_stats_status_and_list_count_from_the_same_moment(
    daemon: Daemon, client: rtcf.Client
) -> None:
    policy = runner_pb2.OVERRUN_POLICY_SKIP
    settings = runner_pb2.RunnerSettings(
        frequency_hz=20000.0, overrun=policy, orphan_timeout_s=600.0
    )
    client.set_runner(settings)
    client.load(_slow("slow"))
    client.load(rtcf.component("rtcf_faults", "NotFinite", name="odd", parameters=["after:=0"]))

    def told(*verb: str) -> Any:
        return json.loads(daemon.ctl(*verb, "-o", "json").stdout)

    def late() -> tuple[int, int]:
        """Return the overruns and missed cycles of a stopped loop, identical in all views."""
        found = [told("stats"), *told("status")["runners"], *told("runner", "list")]
        (same,) = {(each["overruns"], each["missed"]) for each in found}
        return same

    def faults() -> int:
        """Return the faults of the loop, identical in all views."""
        (status,) = told("status")["runners"]
        by_component = [{each["component"]: each["faults"] for each in told("stats")["components"]},
                        {each["full_name"]: each["faults"] for each in told("list")}]  # fmt: skip
        assert by_component == [{"/slow": 0, "/odd": status["faults"]}] * 2
        return int(status["faults"])

    def run(client: rtcf.Client) -> int:
        """Run the loop for a while; return the number of its cycles."""
        client.start()
        wait_for(lambda: client.get_statistics().overruns > 20, "overruns")
        assert daemon.ctl("stats", "--reset").returncode == 0
        wait_for(lambda: client.get_statistics().overruns > 20, "overruns")
        client.stop()
        return iteration(client)

    cycles = run(client)
    overruns, missed = late()
    assert 20 < overruns < cycles
    assert missed > 0
    # Faults count from the start of the loop; a reset of statistics does not change them.
    assert faults() == cycles
    # The same for an rtcfd that started after the statistics.
    daemon.end(signal.SIGKILL)
    daemon.start()
    assert (late(), faults()) == ((overruns, missed), cycles)
    assert daemon.ctl("stats", "--reset").returncode == 0
    assert (late(), faults()) == ((0, 0), cycles)
    # Another start resets all of them.
    with rtcf.Client(daemon.socket) as another:
        again = run(another)
    assert late()[0] < again
    assert faults() == again


def test_cycles_of_a_stopped_loop_are_the_same_in_status_and_statistics(
    client: rtcf.Client,
) -> None:
    client.set_runner(runner_pb2.RunnerSettings(warmup_cycles=0))
    client.load(rtcf.component("rtcf_test", "Counter"))
    client.step(100)
    before = iteration(client)
    client.reset_statistics()
    assert client.get_statistics().iterations == 0
    client.step(30)
    statistics = client.get_statistics()
    assert iteration(client) - before == statistics.iterations == 30
    assert statistics.components[0].duration.count == 30


def test_statistics_can_be_watched(daemon: Daemon, client: rtcf.Client) -> None:
    client.load(rtcf.component("rtcf_test", "Counter"))
    client.start()
    seen = [
        each.iterations for each in itertools.islice(client.watch_statistics(interval_s=0.1), 5)
    ]
    assert seen == sorted(set(seen)), "each report has more cycles than the previous one"
    # rtcfctl shows them, too.
    assert json.loads(daemon.ctl("stats", "-o", "json").stdout)["iterations"] > 0


def test_the_duration_of_a_change_is_measured(daemon: Daemon, client: rtcf.Client) -> None:
    client.start()
    assert "adoption" not in daemon.ctl("stats").stdout
    client.load(rtcf.component("rtcf_test", "Counter"))
    client.unload(["Counter"])
    adoption = client.get_statistics().adoption
    assert adoption.count == 2
    assert 0 < adoption.min_ns <= adoption.max_ns
    assert "adoption of a change" in daemon.ctl("stats").stdout


def test_an_unloaded_component_leaves_the_statistics(client: rtcf.Client) -> None:
    client.load(rtcf.component("rtcf_test", "Counter", name="a", remaps=["out:=/a"]))
    client.load(rtcf.component("rtcf_test", "Counter", name="b", remaps=["out:=/b"]))
    client.start()
    wait_for(lambda: client.get_statistics().iterations > 100, "100 cycles")
    client.unload(["a"])
    client.load(rtcf.component("rtcf_test", "Counter", name="a", remaps=["out:=/a"]))
    first, second = client.get_statistics().components
    assert (first.component, second.component) == ("/a", "/b")
    # The new component is not the old one, despite its name.
    assert first.duration.count < second.duration.count


@pytest.mark.parametrize(
    "policy",
    [
        runner_pb2.OVERRUN_POLICY_SKIP,
        runner_pb2.OVERRUN_POLICY_CATCH_UP,
        runner_pb2.OVERRUN_POLICY_RELATIVE,
    ],
)
def test_the_overrun_policy_changes_while_the_loop_runs(
    client: rtcf.Client, policy: runner_pb2.OverrunPolicy
) -> None:
    client.set_runner(runner_pb2.RunnerSettings(frequency_hz=10000.0))
    client.load(_slow("slow"))
    client.start()
    client.set_runner(runner_pb2.RunnerSettings(overrun=policy))
    wait_for(lambda: iteration(client) > 20, "some cycles")
    client.reset_statistics()
    wait_for(lambda: client.get_statistics().overruns > 50, "overruns")
    statistics = client.get_statistics()
    if policy == runner_pb2.OVERRUN_POLICY_CATCH_UP:
        # It falls behind, and drops cycles only after a hundred late ones in a row.
        assert statistics.latency.max_ns > 100_000
    else:
        assert (statistics.missed > 0) == (policy == runner_pb2.OVERRUN_POLICY_SKIP)


def test_incompatible_rates_are_rejected_with_a_compatible_one(
    daemon: Daemon, client: rtcf.Client
) -> None:
    def load(name: str, *every: str) -> str:
        done = daemon.ctl(
            "load", "rtcf_test", "Counter", "--name", name, "--remap", f"out:=/{name}", *every
        )
        return done.stderr

    assert load("four", "--every", "4") == ""
    client.start()
    refused = load("six", "--every", "6")
    assert "/six runs every 6 cycles" in refused
    assert "try --every 4 or 8" in refused
    assert client.get_order() == ["/four"]
    assert load("eight", "--every", "8") == ""
    wait_for(lambda: iteration(client) > 200, "200 cycles")
    client.stop()
    counts = {each: port_value(client, each, "out") for each in ("four", "eight")}
    assert counts["four"] in (iteration(client) // 4, iteration(client) // 4 + 1)
    assert 0 < counts["eight"] <= counts["four"] // 2 + 1

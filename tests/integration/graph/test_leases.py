"""Leased components and runners stay only as long as their lease."""

import json
import signal
from pathlib import Path
from typing import Any

import pytest
import rtcf
from daemon_process import Daemon, wait_for, wait_until_it_is
from holders import Holder, held, hold, lease, leased
from rtcf.v1 import control_pb2, graph_pb2, runner_pb2
from values import iteration, state, wait_until_after

UNLOAD = control_pb2.ON_LEASE_LOST_UNLOAD
KEEP = control_pb2.ON_LEASE_LOST_KEEP
ENDED = control_pb2.LeaseEnded


def counter(name: str) -> graph_pb2.ComponentSpec:
    return rtcf.component("rtcf_test", "Counter", name=name, ns="/", remaps=["out:=~out"])


def knobs(name: str) -> graph_pb2.ComponentSpec:
    return rtcf.component("rtcf_test", "Knobs", name=name, parameters=["rate:=1"])


def set_rate(client: rtcf.Client, name: str, rate: int, **more: Any) -> None:
    client.set_parameters(name, [rtcf.parse_parameter(f"rate:={rate}")], **more)


def rate_of(client: rtcf.Client, name: str) -> float:
    found = client.get_component(name).parameters
    return float(next(each.value.double_value for each in found if each.name == "rate"))


def names(client: rtcf.Client) -> list[str]:
    return [info.full_name for info in client.list_components()]


def witness(name: str, *parameters: str) -> graph_pb2.ComponentSpec:
    return rtcf.component("rtcf_test", "Witness", name=name, parameters=parameters)


def records(holder: Holder, component: str) -> list[str]:
    """Return the log records of a component that a holder has received."""
    return [
        record.message
        for batch in holder.of("logs")
        for record in batch.records
        if record.component == component
    ]


def report_of_a_run(holder: Holder) -> Any:
    """Return the newest report if the loop runs."""
    reports = holder.of("report")
    return reports[-1] if reports and reports[-1].running else None


def running(client: rtcf.Client) -> bool:
    return bool(state(client).state == runner_pb2.RUNNER_STATE_RUNNING)


def test_a_component_leaves_at_the_end_of_its_lease_and_the_loop_continues(
    client: rtcf.Client,
) -> None:
    client.load(counter("stays"))
    holder = leased(client, counter("leaves"))
    client.start()
    (found,) = (info for info in client.list_components() if info.full_name == "/leaves")
    assert found.holder == "holder of leaves"
    holder.end()
    assert names(client) == ["/stays"]
    wait_until_after(client, iteration(client) + 10)


def test_the_death_of_a_holder_stops_the_loop_and_unloads_its_component(
    client: rtcf.Client, daemon: Daemon
) -> None:
    client.load(counter("stays"))
    holder = leased(client, counter("leaves"))
    client.start()
    holder.lease.drop()
    wait_for(lambda: names(client) == ["/stays"], "the unload of the component")
    assert state(client).state == runner_pb2.RUNNER_STATE_STOPPED
    assert "/leaves: holder of leaves has died: stopping the loop" in daemon.log()


def test_the_death_of_a_holder_only_unloads_its_component_if_requested(
    client: rtcf.Client,
) -> None:
    client.load(counter("stays"))
    holder = leased(client, counter("leaves"), UNLOAD)
    client.start()
    holder.lease.drop()
    wait_for(lambda: names(client) == ["/stays"], "the unload of the component")
    wait_until_after(client, iteration(client) + 10)


def test_a_component_leased_with_keep_is_saved_after_its_holders_death(
    client: rtcf.Client, daemon: Daemon
) -> None:
    holder = leased(client, counter("kept"), KEEP)
    client.start()
    assert "kept" not in saved(daemon)["components"]
    holder.lease.drop()
    wait_for(lambda: saved(daemon)["components"], "the component in the saved graph")
    wait_until_after(client, iteration(client) + 10)
    assert client.get_component("kept").holder == ""


@pytest.mark.parametrize("policy", [UNLOAD, KEEP])
def test_the_death_of_a_holder_undoes_its_changes(client: rtcf.Client, policy: Any) -> None:
    client.load(knobs("one"))
    client.load(knobs("two"))
    holder = leased(client, counter("leaves"), policy)
    for rate in (2, 3):
        set_rate(client, "one", rate, undo_with="leaves")
    set_rate(client, "two", 4, undo_with="leaves")
    set_rate(client, "two", 5)
    holder.lease.drop()
    wait_until_it_is(1.0, lambda: rate_of(client, "one"), "the rate of one")
    assert rate_of(client, "two") == 5.0, "another change followed"


def test_the_changes_of_a_dead_holder_are_undone_after_a_restart_of_rtcfd(
    client: rtcf.Client, daemon: Daemon
) -> None:
    client.load(knobs("one"))
    leased(client, counter("leaves"), UNLOAD)
    set_rate(client, "one", 2, undo_with="leaves")
    daemon.end(signal.SIGKILL)
    daemon.start()
    with rtcf.Client(daemon.socket) as again:
        assert rate_of(again, "one") == 2.0
        wait_until_it_is(1.0, lambda: rate_of(again, "one"), "the rate")


def test_a_lease_that_ends_in_order_keeps_the_changes(client: rtcf.Client) -> None:
    client.load(knobs("one"))
    holder = leased(client, counter("leaves"), UNLOAD)
    set_rate(client, "one", 2, undo_with="leaves")
    holder.end()
    assert rate_of(client, "one") == 2.0


def test_a_change_with_a_component_that_is_not_leased_is_rejected(client: rtcf.Client) -> None:
    client.load(knobs("one"))
    with pytest.raises(rtcf.RefusedError, match="/one is not leased") as refused:
        set_rate(client, "one", 2, undo_with="one")
    assert refused.value.reason == "LEASE_NOT_FOUND"
    assert rate_of(client, "one") == 1.0


def test_leases_that_end_together_unload_in_one_transaction(client: rtcf.Client) -> None:
    client.load(counter("stays"))
    other = leased(client, counter("other"), run="other run")
    client.start()

    def transactions() -> int:
        holders = [leased(client, counter(f"leaves{i}")) for i in range(4)]
        before = state(client).generation
        for holder in holders:
            holder.lease.end()
        for holder in holders:
            assert holder.why() == ENDED.WHY_ASKED
        assert sorted(names(client)) == ["/other", "/stays"]
        return state(client).generation - before

    # They must end within 0.2 s of each other, which may fail once on a busy machine.
    assert any(transactions() == 1 for _ in range(10))
    other.end()


def test_a_holder_is_told_if_another_client_unloads_its_component(
    client: rtcf.Client,
) -> None:
    holder = leased(client, counter("taken"))
    client.unload(["taken"])
    assert holder.why() == ENDED.WHY_UNLOADED
    assert "another client" in holder.wait("ended").message


@pytest.mark.parametrize(("type_name", "reason"), [("Throws", "threw"), ("CallsAbort", "SIGABRT")])
def test_the_holder_of_a_failing_component_gets_the_reason_and_others_stay(
    client: rtcf.Client, type_name: str, reason: str
) -> None:
    other = leased(client, counter("other"))
    bad = rtcf.component("rtcf_faults", type_name, name="bad", remaps=["out:=~out"])
    holder = leased(client, bad)
    client.start()
    assert holder.why() == ENDED.WHY_FAILED
    assert reason in holder.wait("ended").message
    wait_for(lambda: names(client) == ["/other"], "the unload of the component")
    client.start()  # the remaining components run again
    assert other.of("ended") == []
    other.end()


def test_a_holder_gets_the_log_records_of_its_component_only(
    client: rtcf.Client,
) -> None:
    first = leased(client, witness("first"))
    second = leased(client, witness("second"))
    client.start()

    def components(holder: object) -> set[str]:
        batches = first.of("logs") if holder is first else second.of("logs")
        return {record.component for batch in batches for record in batch.records}

    wait_for(lambda: components(first) and components(second), "log records")
    assert components(first) == {"/first"}
    assert components(second) == {"/second"}
    for holder in (first, second):
        holder.end()


def test_a_rejected_load_leaves_nothing_behind(client: rtcf.Client, daemon: Daemon) -> None:
    client.load(counter("there"))
    error = lease(client, counter("there")).wait_for_error()
    assert "/there exists already" in str(error)
    error = lease(
        client, rtcf.component("rtcf_test", "FailingConfigure", name="bad")
    ).wait_for_error()
    assert "configure" in str(error)
    error = lease(client, rtcf.component("rtcf_examples", "Mino", name="x")).wait_for_error()
    assert 'did you mean "Mimo"' in str(error)
    error = lease(client, counter("new"), hold="nobody's").wait_for_error()
    assert "the holder of runner rt_runner has ended" in str(error)
    assert names(client) == ["/there"]
    assert saved(daemon)["leased"] == {}


def test_a_loop_outlives_rtcfd_and_returning_holders_keep_their_leases(
    client: rtcf.Client, daemon: Daemon
) -> None:
    patient = runner_pb2.RunnerSettings(orphan_timeout_s=60.0)
    held(client, "back", "1", patient)
    held(client, "away", "2", patient)
    leased(client, counter("comes_back"), runner="back")
    leased(client, counter("stays_away"), UNLOAD, runner="back")
    assert saved(daemon, "back")["components"] == []
    client.start("back")
    before = iteration(client, "back")
    daemon.end(signal.SIGKILL)
    daemon.start()
    with rtcf.Client(daemon.socket) as again:
        assert iteration(again, "back") > before
        runner = held(again, "back", "1", attach=True)
        holder = leased(again, counter("comes_back"), runner="back", attach=True)
        error = lease(again, counter("comes_back"), runner="back", attach=True).wait_for_error()
        assert "keeps no /comes_back" in str(error)
        assert sorted(again.get_order("back")) == ["/comes_back", "/stays_away"]
        # After 10 s of waiting for the other lease holders.
        wait_for(lambda: again.get_order("back") == ["/comes_back"], "the unload of the component")
        wait_for(
            lambda: "away" not in [each.runner for each in again.get_status().runners],
            "the runner whose holder stays away to be removed",
        )
        wait_for(lambda: report_of_a_run(runner), "the report of a running loop")
        holder.end()
        assert again.get_order("back") == []
        runner.end()
        assert [each.runner for each in again.get_status().runners] == ["rt_runner"]


def test_a_leased_runner_gets_its_own_settings_back(client: rtcf.Client, daemon: Daemon) -> None:
    client.set_runner(runner_pb2.RunnerSettings(frequency_hz=100.0, priority=11))
    holder = held(client, settings=runner_pb2.RunnerSettings(frequency_hz=500.0))
    status = state(client)
    assert (status.settings.frequency_hz, status.settings.priority) == (500.0, 11)
    assert (status.holder, status.hold) == ("holder token", "token")
    assert "rt_runner: held by holder token" in daemon.ctl("status").stdout
    assert saved(daemon)["settings"]["frequency_hz"] == 100.0
    member = leased(client, counter("member"), hold="token")
    client.start()
    report = wait_for(lambda: report_of_a_run(holder), "the report of a running loop")
    assert report.components == 1
    holder.end()
    assert member.why() == ENDED.WHY_RUNNER_ENDED
    status = state(client)
    assert (status.settings.frequency_hz, status.hold, status.components) == (100.0, "", 0)
    assert status.state == runner_pb2.RUNNER_STATE_STOPPED


def test_a_runner_in_use_cannot_be_leased(client: rtcf.Client) -> None:
    client.load(counter("own"))
    assert "has components of its own (/own)" in str(hold(client).wait_for_error())
    client.unload(["own"])
    client.start()
    assert "the loop of runner rt_runner runs" in str(hold(client).wait_for_error())
    client.stop()
    holder = held(client)
    assert "is held by holder token" in str(hold(client, token="other").wait_for_error())
    settings = runner_pb2.RunnerSettings(ros=runner_pb2.RosSettings(whitelist="*.ros.*"))
    error = hold(client, "another", "other", settings).wait_for_error()
    assert "whitelist" in str(error) and "*.ros.*" in str(error)
    assert [each.runner for each in client.get_status().runners] == ["rt_runner"]
    holder.end()


@pytest.mark.parametrize("runner", ["rt_runner", "added"])
def test_the_holder_of_a_runner_gets_the_log_records_of_all_hooks(
    client: rtcf.Client, runner: str
) -> None:
    holder = held(client, runner)
    client.load(witness("unleased"), runner)
    client.start(runner)
    wait_for(lambda: iteration(client, runner) > 2, "some cycles")
    holder.end()
    hooks = ["configure", "start", "update", "safe", "stop", "cleanup"]
    assert records(holder, "/unleased") == [f"hook {each}" for each in hooks]


def test_the_holder_of_a_runner_gets_the_last_log_records_of_a_failed_component(
    client: rtcf.Client,
) -> None:
    runner = held(client)
    component = leased(client, witness("bad", "throws:=true"), hold="token")
    client.start()
    assert component.why() == ENDED.WHY_FAILED
    wait_for(lambda: "hook cleanup" in records(runner, "/bad"), "the records of cleanup()")
    runner.end()


def test_an_added_runner_is_removed_with_its_dead_holder(client: rtcf.Client) -> None:
    holder = held(client, "arm")
    member = leased(client, counter("member"), runner="arm", hold="token")
    client.start("arm")
    holder.lease.drop()
    assert member.why() == ENDED.WHY_RUNNER_ENDED
    wait_for(
        lambda: [each.runner for each in client.get_status().runners] == ["rt_runner"],
        "the runner to be removed",
    )


def test_a_launch_lost_with_its_executor_leaves_nothing(
    client: rtcf.Client, daemon: Daemon
) -> None:
    held(client, settings=runner_pb2.RunnerSettings(frequency_hz=500.0, orphan_timeout_s=0.0))
    held(client, "added", "other", runner_pb2.RunnerSettings(orphan_timeout_s=0.0))
    leased(client, counter("member"))
    pids = [status.pid for status in client.get_status().runners]
    daemon.end(signal.SIGKILL)
    for pid in pids:
        wait_for(lambda pid=pid: not Path(f"/proc/{pid}").exists(), "the executors to end")  # type: ignore[misc]
    daemon.start()
    with rtcf.Client(daemon.socket) as again:
        (status,) = again.get_status().runners
        assert (status.runner, status.hold) == ("rt_runner", "")
        assert status.settings.frequency_hz == 1000.0
        assert names(again) == []


def saved(daemon: Daemon, runner: str = "rt_runner") -> Any:
    return json.loads((Path(daemon.socket).parent / "state" / f"{runner}.json").read_text())

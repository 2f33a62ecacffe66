"""Output of the nodes of a launch, and its destination."""

import re

import rosgraph
from daemon_process import wait_for
from launch_processes import Launching

DONE = 0
LAUNCH = """
<launch>
  <node name="rt_runner" pkg="rtcf" type="rt_runner" output="screen">
    <param name="num_components_expected" value="2"/>
    <param name="warmup_cycles" value="3"/>
  </node>
  <node name="quiet" pkg="rtcf" type="rt_launcher" args="rtcf_compat PaperExample"/>
  <node name="loud" pkg="rtcf" type="rt_launcher" args="rtcf_compat PaperExample" output="screen"/>
</launch>
"""


def test_components_log_on_the_runners_screen_if_their_launcher_has_none(
    launching: Launching,
) -> None:
    launch = launching.launch_text(LAUNCH)
    for name in ("quiet", "loud"):
        launch.wait_for_output(f": /{name}: Fetched param with value")
    assert launch.end() == DONE
    # Each line occurs once, not from both nodes.
    for name in ("quiet", "loud"):
        assert launch.output().count(f": /{name}: Fetched param with value") == 1


def test_statistics_are_printed_at_the_end_of_a_loop(launching: Launching) -> None:
    runner = launching.node("rt_runner", "_warmup_cycles:=3", "_frequency:=500")
    runner.wait_for_output("the loop runs")
    with launching.client() as (client, name):
        wait_for(lambda: client.get_statistics(name).duration.count > 20, "some cycles")
        client.stop(name)
    runner.wait_for_output("the loop is stopped")
    runner.wait_for_output(" missed cycles.")
    assert re.search(
        r"Performed [0-9]{2,} iterations \(first 3 ignored\) since last start\.\n"
        r".*Calculation duration: Mean [0-9.]+ us, Max [0-9.]+ us, Min [0-9.]+ us\.\n"
        r".*Wake-up latency: Mean ",
        runner.output(),
    ), runner.output()
    with launching.client() as (client, name):
        client.start(name)
        wait_for(lambda: client.get_statistics(name).duration.count > 20, "more cycles")
    wait_for(lambda: runner.output().count("the loop runs") == 2, "the second start")
    assert runner.end() == DONE
    assert runner.output().count("Performed ") == 2


def test_missing_real_time_rights_are_warned_of_once_per_launch(launching: Launching) -> None:
    runner = launching.node("rt_runner")
    runner.wait_for_output("the loop runs")
    with launching.client() as (client, name):
        client.stop(name)
        client.start(name)
        reasons = list(client.get_status(name).runners[0].degraded)
    wait_for(lambda: runner.output().count("the loop runs") == 2, "the second start")
    assert runner.end() == DONE
    for reason in reasons:
        (line,) = [each for each in runner.output().splitlines() if each.endswith(reason)]
        assert line.startswith("[ WARN] ") and "!! rt_runner IS NOT REAL TIME: " in line


def test_a_loop_that_waits_for_the_clock_says_so(launching: Launching) -> None:
    parameters = rosgraph.Master("/test", launching.master.uri)
    parameters.setParam("/use_sim_time", True)
    try:
        runner = launching.node("rt_runner")
        runner.wait_for_output("the loop follows /clock: its time is simulated")
        silence = "no cycle runs: no message on /clock for "
        runner.wait_for_output(silence)
        assert runner.end() == DONE
        (line,) = [each for each in runner.output().splitlines() if silence in each]
        assert line.startswith("[ WARN] ")
    finally:
        parameters.deleteParam("/use_sim_time")


def test_the_format_of_rosconsole_is_used(launching: Launching) -> None:
    runner = launching.node(
        "rt_runner", "_mode:=wait_for_trigger",
        ROSCONSOLE_FORMAT="<${severity}|${node}|${logger}|${time:%Y}|${what}> ${message}",
    )  # fmt: skip
    runner.wait_for_output("waiting for")
    assert re.search(
        r"^< INFO\|/rt_runner\|ros\.rtcf\|20[0-9]{2}\|\$\{what\}> runner rt_runner at ",
        runner.output(),
        re.MULTILINE,
    ), runner.output()
    launcher = launching.node(
        "rt_launcher", "rtcf_compat", "PaperExample", "__name:=it",
        ROSCONSOLE_FORMAT="${severity} ${logger} ${file}:${line} ${message}",
    )  # fmt: skip
    launcher.wait_for_output("Fetched param")
    assert re.search(
        r"^ INFO ros\.rtcf\./it \S*listing\.cpp:[0-9]+ Fetched param",
        launcher.output(),
        re.MULTILINE,
    ), launcher.output()
    assert (launcher.end(), runner.end()) == (DONE, DONE)

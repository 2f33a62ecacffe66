"""Private parameters and arguments of rt_runner and rt_launcher."""

import os
from pathlib import Path
from typing import Any

import pytest
from rtcf.v1 import control_pb2, graph_pb2, runner_pb2
from rtcf_launch import (
    arguments,
    component_parameters,
    daemon_choice,
    parameters,
    runner_parameters,
)
from rtcf_launch.codes import Code, Ending
from rtcf_launch.component_choice import ComponentChoice
from rtcf_launch.runner_node import runner_name


def error_of(values: dict[str, Any]) -> str:
    with pytest.raises(Ending) as found:
        runner_parameters.read(values)
    assert found.value.code == Code.USAGE
    message = str(found.value)
    assert "\n" not in message
    return message


def test_each_parameter_of_a_runner_is_a_setting() -> None:
    last = max(os.sched_getaffinity(0))
    found, lines = runner_parameters.read(
        {
            "frequency": 500,
            "mode": "wait_for_components",
            "num_components_expected": 3,
            "ros_mapping_whitelist": "/a",
            "ros_mapping_blacklist": "/b",
            "ros_queue": 7,
            "wait_policy": "absolute",
            "max_overruns": 5,
            "lock_memory": False,
            "safe_heap_size_kB": 1000,
            "safe_stack_size_kB": 100,
            "cpu_affinity_mask": 1 << last | 1,
            "priority": 50,
            "spin": "auto",
            "realtime": "preferred",
            "stall_timeout": 1.5,
            "hook_timeout": 30.0,
            "warmup_cycles": 3,
            "on_crash": "resume",
            "ros_latch": "/l",
            "ros_decimation": 4,
            "ros_decimate": "/d",
            "ros_stamped": "/s",
            "ros_peers": "Tune",
            "ros_largest_message_kB": 512,
            "sim_time": "never",
            "max_clock_jump": 2.5,
            "daemon": "private",
            "on_fault": "stay",
        }
    )
    assert lines == []
    assert (found.mode, found.components, found.daemon, found.exit_on_fault) == (
        "wait_for_components",
        3,
        "private",
        False,
    )
    assert found.settings == runner_pb2.RunnerSettings(
        frequency_hz=500.0,
        overrun=runner_pb2.OVERRUN_POLICY_CATCH_UP,
        max_overruns=5,
        lock_memory=False,
        heap_kb=1000,
        stack_kb=100,
        cpu=last,
        priority=50,
        spin_auto=True,
        realtime=runner_pb2.REALTIME_PREFERRED,
        stall_timeout_ms=1500,
        hook_timeout_s=30.0,
        warmup_cycles=3,
        on_crash=runner_pb2.ON_CRASH_RESUME,
        sim_time=runner_pb2.SIM_TIME_NEVER,
        max_clock_jump_s=2.5,
        ros=runner_pb2.RosSettings(
            whitelist="/a", blacklist="/b", queue=7,
            latch="/l", decimation=4, decimate="/d", stamped="/s",
            largest_message_kb=512, peers=runner_pb2.RIGHT_TUNE,
        ),
    )  # fmt: skip


GRAPH = """\
settings: {frequency_hz: 500, priority: 70, ros: {whitelist: /a}}
components:
  - {package: rtcf_examples, type: Wave}
  - {package: rtcf_examples, type: Mimo}
"""


def test_a_graph_file_has_components_and_settings_that_parameters_override(tmp_path: Path) -> None:
    file = tmp_path / "graph.yaml"
    file.write_text(GRAPH)
    found, lines = runner_parameters.read({"graph": str(file), "priority": 75})
    assert lines == []
    assert [each.type for each in found.graph] == ["Wave", "Mimo"]
    assert (found.mode, found.components) == ("wait_for_components", 2)
    settings = found.settings
    assert (settings.frequency_hz, settings.priority, settings.ros.whitelist) == (500, 75, "/a")


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (None, "~graph {file}: No such file or directory"),
        (b"components: ]", "~graph {file}:1: "),
        (b"\xff\xfe", "~graph {file}: not UTF-8 text"),
        (b"runners: {a: {components: []}, b: {components: []}}", "~graph {file} has 2 runners"),
    ],
)
def test_an_unsuitable_graph_file_is_one_clear_line(
    tmp_path: Path, text: bytes | None, said: str
) -> None:
    file = tmp_path / "graph.yaml"
    if text is not None:
        file.write_bytes(text)
    with pytest.raises(Ending) as error:
        runner_parameters.read({"graph": str(file)})
    assert str(error.value).startswith(said.format(file=file))
    assert "\n" not in str(error.value)


def test_missing_parameters_are_left_to_the_daemon() -> None:
    found, lines = runner_parameters.read({})
    assert found.settings == runner_pb2.RunnerSettings()
    assert (found.mode, found.daemon, found.exit_on_fault, lines) == ("no_wait", "auto", True, [])
    found, _ = runner_parameters.read({"num_components_expected": 2})
    assert found.mode == "wait_for_components"


def test_parameters_of_rtcf_2021_are_accepted() -> None:
    found, lines = runner_parameters.read({"mode": "No_Wait", "safe_stack_size_kB": 0})
    assert (found.mode, found.settings.stack_kb, lines) == ("no_wait", 16, [])


@pytest.mark.parametrize("text", ["1e-3", "1E-3", "+1e-3", ".1e-2", "1.e-3"])
def test_a_text_that_yaml_does_not_read_as_a_number_is_one(text: str) -> None:
    assert parameters.as_number(text) == 0.001
    read, _ = runner_parameters.read({"frequency": "1e3"})
    assert read.settings.frequency_hz == 1000.0
    for other in ("fast", "1e", "nan", "0x1", "1_0", "\u0661", ""):
        assert parameters.as_number(other) == other


def test_numbers_are_converted_as_in_roscpp() -> None:
    last = max(os.sched_getaffinity(0))
    found, _ = runner_parameters.read(
        {
            "frequency": 500,
            "num_components_expected": 2.0,
            "lock_memory": 0,
            "cpu_affinity_mask": float(1 << last),
            "spin": 5.0,
        }
    )
    assert (found.settings.frequency_hz, found.components) == (500.0, 2)
    assert (found.settings.lock_memory, found.settings.cpu) == (False, last)
    assert found.settings.spin_us == 5
    launcher, _ = component_parameters.read({"is_first": 1, "every": 2.0})
    assert (launcher.first, launcher.every) == (True, 2)


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({"frequency": 0}, "~frequency of 0 is out of range: 0.1 to 50000"),
        ({"frequency": float("nan")}, "~frequency of nan is out of range"),
        ({"frequency": True}, "~frequency must be a number, not True"),
        ({"mode": "wait"}, "~mode must be one of wait_for_components, no_wait, wait_for_trigger"),
        ({"mode": "wait_for_components"}, "wait_for_components: set ~num_components_expected"),
        ({"num_components_expected": 0}, "~num_components_expected of 0 is out of range"),
        ({"num_components_expected": 2.5}, "~num_components_expected must be an integer, not 2.5"),
        ({"num_components_expected": True}, "must be an integer, not True"),
        ({"lock_memory": 2}, "~lock_memory must be true or false, not 2"),
        ({"lock_memory": 1.0}, "~lock_memory must be true or false, not 1.0"),
        ({"ros_mapping_whitelist": 5}, "~ros_mapping_whitelist must be a string, not 5"),
        (
            {"wait_policy": "absolut"},
            '~wait_policy must be one of absolute, relative, not "absolut',
        ),
        ({"wait_policy": "relative", "overrun": "skip"}, "both set the overrun policy"),
        ({"lock_memory": "yes"}, '~lock_memory must be true or false, not "yes"'),
        ({"safe_heap_size_kB": -1}, "~safe_heap_size_kB of -1 is out of range"),
        ({"safe_stack_size_kB": -8}, "~safe_stack_size_kB of -8 is out of range: 0 to"),
        ({"ros_decimation": 0}, "~ros_decimation of 0 is out of range: 1 to"),
        ({"sim_time": "sometimes"}, "~sim_time must be one of auto, never, always"),
        ({"cpu_affinity_mask": 0}, "~cpu_affinity_mask must be an integer with a bit"),
        ({"cpu_affinity_mask": 1 << 30}, "has none of the CPUs that may be used"),
        ({"cpu_affinity_mask": 1, "cpu": 0}, "both set the CPU"),
        ({"priority": 99}, "~priority of 99 is out of range: 1 to 98"),
        ({"spin": "a lot"}, "~spin must be a number of µs or"),
        ({"daemon": "mine"}, "~daemon must be one of auto, system, private"),
        ({"on_fault": 1}, "~on_fault must be one of exit, stay, not 1"),
    ],
)
def test_a_wrong_parameter_of_a_runner_is_one_clear_line(
    values: dict[str, Any], message: str
) -> None:
    assert message in error_of(values)


def test_an_unknown_parameter_is_a_warning_with_a_suggestion() -> None:
    _, lines = runner_parameters.read(
        {"freqency": 1000, "robot": "r1", "rtcf_runner": {"socket": "/s"}}
    )
    assert lines == [
        "rt_runner has no parameter ~freqency; did you mean ~frequency?",
        "rt_runner has no parameter ~robot",
    ]


def test_a_launcher_passes_other_parameters_to_the_component() -> None:
    found, notes = component_parameters.read(
        {
            "runner": "arm",
            "is_first": True,
            "topics_ignore_for_graph": ["/a", "/b.*"],
            "every": 4,
            "phase": 1,
            "optional": True,
            "on_lease_lost": "keep",
            "kp": 2,
        }
    )
    assert (found.runner, found.first, found.ignore) == ("arm", True, "/a|/b.*")
    assert (found.every, found.phase, found.optional) == (4, 1, True)
    assert (found.on_lost, found.others) == (control_pb2.ON_LEASE_LOST_KEEP, {"kp": 2})
    assert notes == []


def test_the_components_parameters_precede_the_launchers() -> None:
    values = {"every": 0.5, "phase": 1, "optional": True, "runner": "arm", "rtcf_every": 2}
    found, notes = component_parameters.read(values, ["every", "phase", "optional", "runner"])
    assert (found.every, found.phase, found.optional, found.runner) == (2, None, False, None)
    assert found.others == {"every": 0.5, "phase": 1, "optional": True, "runner": "arm"}
    assert notes[-1] == (
        "~optional belongs to the component, not to rt_launcher (use ~rtcf_optional): "
        "the component declares it"
    )


def test_values_unsuitable_for_a_launcher_go_to_the_component_with_a_note() -> None:
    found, notes = component_parameters.read({"every": 0.5, "phase": 2, "on_lease_lost": "die"})
    assert (found.every, found.phase) == (0, None)
    assert found.others == {"every": 0.5, "phase": 2, "on_lease_lost": "die"}
    assert notes == [
        "~every belongs to the component, not to rt_launcher (use ~rtcf_every): "
        "~every must be an integer, not 0.5",
        "~on_lease_lost belongs to the component, not to rt_launcher (use ~rtcf_on_lease_lost): "
        '~on_lease_lost must be one of stop, unload, keep, not "die"',
        "~phase belongs to the component, not to rt_launcher (use ~rtcf_phase): "
        "it has no effect without ~every",
    ]


@pytest.mark.parametrize(
    "values",
    [
        {"is_first": "yes"},
        {"topics_ignore_for_graph": 3},
        {"topics_ignore_for_graph": ["/a", 3]},
        {"rtcf_every": 0},
        {"rtcf_on_lease_lost": "die"},
        {"rtcf_runner": 7},
    ],
)
def test_a_wrong_parameter_of_a_launcher_is_named(values: dict[str, Any]) -> None:
    with pytest.raises(Ending) as found:
        component_parameters.read(values)
    assert found.value.code == Code.USAGE
    assert f"~{next(iter(values))} " in str(found.value)


def test_declared_parameters_get_values_of_their_type() -> None:
    declared = {name: graph_pb2.ParameterInfo(name=name, type="double") for name in ("kp", "limit")}
    settings, rest, slips = component_parameters.settings({"kp": 2, "gains": {"a": 1}}, declared)
    assert [(each.name, each.value.int_value) for each in settings] == [("kp", 2)]
    assert (rest, slips) == (["gains"], [])
    settings, rest, slips = component_parameters.settings({"limt": 1.0}, declared)
    assert (settings, rest) == ([], ["limt"])
    assert slips == ["the component declares no parameter ~limt; did you mean ~limit?"]
    with pytest.raises(Ending, match="~kp must be one double, not a list"):
        component_parameters.settings({"kp": [1, 2]}, declared)


GROUPED = {
    name: graph_pb2.ParameterInfo(name=name, type="double")
    for name in ("gains/p", "gains/filter/q", "k_0", "k_1", "m_0_0", "m_0_1", "text")
}
VECTOR = {
    **{name: graph_pb2.ParameterInfo(name=name, type="double") for name in ("g/v_0", "g/v_1")},
    "g/v_size": graph_pb2.ParameterInfo(name="g/v_size", type="int", vector="g/v"),
}


def test_mappings_are_groups_and_lists_are_arrays_where_these_are_declared() -> None:
    settings, rest, slips = component_parameters.settings(
        {
            "gains": {"p": 2, "filter": {"q": 3}, "d": 4},
            "k": [5, 6],
            "m": [[7, 8]],
            "limits": {"low": 1, "high": [2]},
            "joints": ["a", "b"],
        },
        GROUPED,
    )
    assert {each.name: each.value.int_value for each in settings} == {
        "gains/p": 2, "gains/filter/q": 3, "k_0": 5, "k_1": 6, "m_0_0": 7, "m_0_1": 8,
    }  # fmt: skip
    assert (rest, slips) == (["gains/d", "joints", "limits"], [])


@pytest.mark.parametrize(
    ("values", "warning"),
    [
        ({"gains": {"filters": {"q": 1}}}, "no parameter ~gains/filters; did you mean ~gains/f"),
        ({"gains": {"unlike": {"q": 1}}}, ""),
        ({"gains": {"filter": {"qq": 1}}}, "declares no parameter ~gains/filter/qq; did you mean"),
        ({"gains": 1.0}, "~gains is a group of parameters: set ~gains/NAME"),
        ({"gains": {"filter": [1]}}, "~gains/filter is a group of parameters"),
        ({"k": 1.0}, "~k is an array: set a list, or its elements ~k_0 …"),
        ({"k": [1, 2, 3]}, "~k has 3 values: the component takes 2"),
        ({"m": [[1], [2]]}, "~m has 2 values: the component takes 1"),
        ({"m": [1]}, "~m_0 is an array: set a list"),
        ({"k": [1], "k_0": 9}, "~k_0 is ignored: ~k sets it, too"),
        ({"k_0": 9, "k": [1]}, "~k_0 is ignored: ~k sets it, too"),
        # What remains of a group at the parameter server when its members are deleted.
        ({"gains": {"filter": {}}, "k": []}, ""),
    ],
)
def test_values_that_fit_no_group_or_array_cause_a_warning(
    values: dict[str, Any], warning: str
) -> None:
    settings, _, slips = component_parameters.settings(values, GROUPED)
    assert len(slips) == (1 if warning else 0)
    assert not warning or warning in slips[0]
    assert all(each.value.int_value != 9 for each in settings)


@pytest.mark.parametrize(
    ("values", "expected", "warning"),
    [
        ({"v": [7]}, {"g/v_0": 7, "g/v_size": 1}, ""),
        ({"v": [7, 8]}, {"g/v_0": 7, "g/v_1": 8, "g/v_size": 2}, ""),
        ({"v": []}, {"g/v_size": 0}, ""),
        ({"v_1": 8}, {"g/v_1": 8}, ""),
        ({"v_1": 8, "v_size": 2}, {"g/v_1": 8, "g/v_size": 2}, ""),
        ({"v": [7], "v_size": 2}, {"g/v_0": 7, "g/v_size": 1}, "~g/v_size is ignored"),
        ({"v": [7, 8, 9]}, {"g/v_0": 7, "g/v_1": 8, "g/v_size": 2}, "the component takes 2"),
        ({"v": 7}, {}, "~g/v is an array: set a list"),
    ],
)
def test_a_list_sets_the_elements_and_the_size_of_a_vector(
    values: dict[str, Any], expected: dict[str, int], warning: str
) -> None:
    settings, _, slips = component_parameters.settings({"g": values}, VECTOR)
    assert {each.name: each.value.int_value for each in settings} == expected
    assert len(slips) == (1 if warning else 0)
    assert not warning or warning in slips[0]


@pytest.mark.parametrize("wrong", [{"gains": {"p": []}}, {"gains": {"p": {}}}, {"k": [[1], 2]}])
def test_a_list_for_a_single_parameter_is_rejected(wrong: dict[str, Any]) -> None:
    with pytest.raises(Ending, match="must be one double, not a"):
        component_parameters.settings(wrong, GROUPED)


def test_a_group_or_array_with_a_launchers_name_belongs_to_the_component() -> None:
    declared = ("phase_0", "phase_1", "every/rate")
    found, notes = component_parameters.read({"phase": [0.0, 1.5], "every": {"rate": 2}}, declared)
    assert (found.every, found.phase) == (0, None)
    assert found.others == {"phase": [0.0, 1.5], "every": {"rate": 2}}
    assert all("the component declares it" in each for each in notes)


def test_arguments_are_parsed_as_by_a_ros_node() -> None:
    given = arguments.parse(
        ["pkg", "Type", "in:=/a", "_kp:=2.5", "_label:='7'", "__name:=H1", "__log:=/l/H1-2.log"],
        {"ROS_NAMESPACE": "arm/left", "ROS_MASTER_URI": "http://m:1", "ROS_IP": "10.0.0.1"},
        "",
    )
    assert given.words == ["pkg", "Type"]
    assert given.full_name == "/arm/left/H1"
    assert given.remaps == [("in", "/a")]
    assert given.private == {"kp": 2.5, "label": "7"}
    assert (given.master_uri, given.hostname) == ("http://m:1", "10.0.0.1")
    assert given.log_file == "/l/H1-2.log"


def test_a_relative_runner_is_searched_from_the_own_namespace_upward() -> None:
    assert arguments.upward("rt_runner", "/arm/left") == [
        "/arm/left/rt_runner",
        "/arm/rt_runner",
        "/rt_runner",
    ]
    assert arguments.upward("/rt_runner", "/arm") == ["/rt_runner"]
    assert runner_name("/arm/left/rt_runner") == "arm_left_rt_runner"


def test_masters_are_equal_if_host_and_port_are() -> None:
    assert daemon_choice.same_master("http://localhost:11311", "http://127.0.0.1:11311/")
    assert not daemon_choice.same_master("http://localhost:11311", "http://localhost:11312")
    assert not daemon_choice.same_master("http://localhost:11311", "http://robot.example:11311")


def test_the_component_is_named_by_arguments_or_parameters() -> None:
    for words in (
        ["-f", "pkg", "T"],
        ["--is_first", "pkg", "ns::T"],
        ["pkg", " T ", "-f"],
        # RTCF 2021's other options and abbreviations
        ["--is", "-c", "pkg", "-cT"],
        ["-fc", "pkg", "T"],
        ["pkg", "--component_info=T", "-f"],
        ["--comp", "pkg", "T", "--is_f"],
    ):
        assert ComponentChoice.parse(words).with_parameters({"gain": 1}) == ComponentChoice(
            "pkg", "T", True
        )
    assert ComponentChoice.parse(["pkg", "T"]).with_parameters({}) == ComponentChoice("pkg", "T")
    values = {"rt_package": "pkg", "rt_type": "T", "gain": 1}
    assert ComponentChoice.parse(["-f"]).with_parameters(values) == ComponentChoice(
        "pkg", "T", True
    )
    assert values == {"gain": 1}  # only the component's


@pytest.mark.parametrize(
    ("words", "values", "message"),
    [
        (["pkg"], {}, "name a package and a component"),
        (["pkg", "T", "more"], {}, "name a package and a component"),
        (["--first", "pkg", "T"], {}, "option --first not recognized: use -f, --is_first, -c, "),
        (["pkg", "-c"], {}, "option -c requires argument: use -f"),
        ([], {}, "by ~rt_package and ~rt_type"),
        ([], {"rt_type": "T"}, "by ~rt_package and ~rt_type"),
        (["pkg", "T"], {"rt_type": "T"}, "~rt_type and the arguments both name the component"),
        (["-f", "pkg", "T"], {"is_first": False}, "~is_first and -f both make the component first"),
        ([], {"rt_type": 5, "rt_package": "pkg"}, "~rt_type must be a string, not 5"),
    ],
)
def test_a_component_named_not_exactly_once_is_rejected(
    words: list[str], values: dict[str, Any], message: str
) -> None:
    with pytest.raises(Ending) as raised:
        ComponentChoice.parse(words).with_parameters(values)
    assert message in str(raised.value)
    assert raised.value.code == Code.USAGE

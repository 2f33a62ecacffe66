"""Numeric settings: units on the command line, and one table for all their descriptions."""

import re

import pytest
from pages import TREE
from rtcf.v1 import runner_pb2
from rtcf_shared import quantities
from rtcf_shared.quantities import ROS, RUNNER, Quantity
from rtcfctl.loop.runner import settings_of
from rtcfctl.main import parser
from rtcfd.common import runner_settings
from rtcfd.common.errors import InvalidArgument

EVERY = [
    *((f"{name}", message, quantity) for message, known in (("RunnerSettings", RUNNER),
      ("RosSettings", ROS)) for name, quantity in known.items()),
]  # fmt: skip


def given(*words: str) -> runner_pb2.RunnerSettings:
    return settings_of(parser().parse_args(["runner", "set", *words]))


@pytest.mark.parametrize(
    ("words", "field", "value"),
    [
        ("--spin 30us", "spin_us", 30),
        ("--spin 0.03ms", "spin_us", 30),
        ("--spin 30", "spin_us", 30),
        ("--stall-timeout 2s", "stall_timeout_ms", 2000),
        ("--hook-timeout 500ms", "hook_timeout_s", 0.5),
        ("--orphan-timeout 1min", "orphan_timeout_s", 60.0),
        ("--max-clock-jump 500ms", "max_clock_jump_s", 0.5),
        ("--frequency 2kHz", "frequency_hz", 2000.0),
        ("--heap-kb 8MiB", "heap_kb", 8192),
    ],
)
def test_every_option_accepts_the_same_units(words: str, field: str, value: float) -> None:
    assert getattr(given(*words.split()), field) == value


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (
            "--spin 30parsecs",
            "argument --spin: 30parsecs: give a number with one of ns, us, µs, ms, s",
        ),
        ("--spin 1.5", "argument --spin: 1.5 is not a whole number of µs"),
        ("--spin 1e400us", "argument --spin: 1e400us is not a whole number of µs"),
        ("--priority 1e400", "argument --priority: 1e400 is not a whole number"),
        ("--frequency fast", "argument --frequency: fast: give a number with one of Hz, kHz"),
    ],
)
def test_an_invalid_number_is_a_usage_error(
    words: str, said: str, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(SystemExit) as left:
        given(*words.split())
    assert left.value.code == 2
    assert said in capsys.readouterr().err


@pytest.mark.parametrize(("name", "message", "quantity"), EVERY)
def test_rtcfd_accepts_exactly_the_values_in_range(
    name: str, message: str, quantity: Quantity
) -> None:
    def check(value: float) -> None:
        settings = runner_pb2.RunnerSettings()
        to = settings.ros if message == "RosSettings" else settings
        setattr(to, name, value if isinstance(quantity.default, float) else int(value))
        runner_settings.check(settings)

    check(quantity.low)
    check(quantity.high)
    check(quantity.default)
    with pytest.raises(InvalidArgument, match=f"out of range: {quantity.range()}"):
        check(quantity.high + 1)


@pytest.mark.parametrize(("name", "message", "quantity"), EVERY)
def test_descriptions_of_settings_match_the_table(
    name: str, message: str, quantity: Quantity
) -> None:
    default = f"{quantity.default:g}"
    proto = (TREE / "proto" / "rtcf" / "v1" / "runner.proto").read_text()
    (comment,) = re.findall(rf"^ +optional \w+ {name} = \d+; *// (.*)$", proto, re.M)
    assert re.search(rf"default {re.escape(default)}\b", comment), comment
    for low, high in re.findall(r"([\d.]+) to ([\d.]+)", comment):
        assert (float(low), float(high)) == (quantity.low, quantity.high)
    toml = (TREE / "systemd" / "rtcfd.toml").read_text()
    (line,) = re.findall(rf"^#{name} = (.*)$", toml, re.M)
    value, _, said = line.partition("#")
    assert float(value) == quantity.default
    for low, high in re.findall(r"([\d.]+) to ([\d.]+)", said):
        assert (float(low), float(high)) == (quantity.low, quantity.high)
    manual = (TREE / "docs" / "man" / "rtcfd.toml.5").read_text().replace("\\-", "-")
    assert re.search(rf"^\.B {name}\n\({re.escape(default)}\b", manual, re.M), name


def test_a_number_keeps_its_digits() -> None:
    assert quantities.parse("29us", "µs") == 29
    assert quantities.parse("-1.5e-3", "s") == -0.0015

"""Settings: defaults, the configuration file, valid values."""

import os
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import odd_files
import pytest
from pages import TREE
from rtcf.v1 import runner_pb2
from rtcfd.access.rights import Access
from rtcfd.common import runner_settings
from rtcfd.common.errors import RequestError
from rtcfd.common.limits import Limits
from rtcfd.configuration import options, settings_file


def written(tmp_path: Path, text: str) -> Path:
    file = tmp_path / "rtcfd.toml"
    file.write_text(text)
    return file


def test_every_setting_has_a_default() -> None:
    defaults = runner_settings.defaults(runner_pb2.REALTIME_REQUIRED)
    complete = runner_settings.completed(defaults)
    messages: list[Any] = [complete, complete.ros]
    for message in messages:
        for field in message.DESCRIPTOR.fields:
            assert message.HasField(field.name), field.name
    runner_settings.check(complete)


def test_a_file_is_read(tmp_path: Path) -> None:
    file = written(
        tmp_path,
        """
        [daemon]
        socket = "/run/x.sock"
        path = ["/opt/a/lib/rtcf"]
        realtime = "preferred"
        [runner]
        frequency_hz = 2000
        overrun = "catch_up"
        [runner.ros]
        whitelist = "/a.*"
        peers = "tune"
        """,
    )
    found = settings_file.read(file)
    assert (found.socket, found.realtime) == (Path("/run/x.sock"), "preferred")
    assert found.path == [Path("/opt/a/lib/rtcf")]
    assert found.runner == runner_pb2.RunnerSettings(
        frequency_hz=2000.0,
        overrun=runner_pb2.OVERRUN_POLICY_CATCH_UP,
        ros=runner_pb2.RosSettings(whitelist="/a.*", peers=runner_pb2.RIGHT_TUNE),
    )


# Two rules, of which the second contains a mistake.
RULES = (
    "[[access.parameters]]\nwho = ['a']\n\n"
    "[[access.parameters]] # of b\nwho = ['b']\n"
)  # fmt: skip


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("[deamon]", 'unknown key "deamon"; did you mean "daemon"'),
        ("[daemon]\nsockte = 1", 'unknown key "daemon.sockte"; did you mean "socket"'),
        ("[runner.ros]\nfoo = 1", 'unknown key "runner.ros.foo"'),
        ("[daemon]\nsocket = 1", "daemon.socket must be an absolute path"),
        ('[daemon]\nsocket = "x"', "daemon.socket must be an absolute path"),
        ('[daemon]\nrealtime = "no"', "daemon.realtime must be one of required, preferred"),
        (
            '[runner.ros]\npeers = "all"',
            "runner.ros.peers must be one of none, observe, tune, operate, admin, not 'all'",
        ),
        ("daemon = 1", "daemon must be a table"),
        ("[runner]\npriority = true", "runner.priority must be an integer"),
        ("[runner]\npriority = -1", "runner.priority is out of range"),
        ("[runner]\npriority = 99", "priority of 99 is out of range: 1 to 98"),
        ('[runner]\nlock_memory = "yes"', "runner.lock_memory must be true or false"),
        ("[runner]\nros = 1", "runner.ros must be a table"),
        ("[runner]\n!", "line 2"),
        ("[runner]\npriority = 5\n\nspin_us = -1", "rtcfd.toml:4: runner.spin_us is out of"),
        ("[daemon]\n[runner.ros]\nmaster_uri = 'x'", ':3: ROS master URI "x" is not valid'),
        ("[runner.ros]\nmaster_uri = 'http://x:1'\nqueue = 0", "rtcfd.toml:3: "),
        ("[runner]\nros = {queue = 0}", "rtcfd.toml:2: "),
        (RULES + "most_per_s = 0", "rtcfd.toml:6: access.parameters: most_per_s must be above 0"),
        (
            RULES + "runner = '('",
            "rtcfd.toml:6: access.parameters: '(' is not a regular expression",
        ),
        (
            RULES + "names = ['(']",
            "rtcfd.toml:6: access.parameters: '(' is not a regular expression",
        ),
        (RULES + "whom = []", 'rtcfd.toml:6: unknown key "access.parameters.whom"'),
        ("\n[[access.parameters]]\nrunner = 'a'", "rtcfd.toml:2: access.parameters: who must be"),
        ("x = " + "[" * 3000 + "]" * 3000, "lists or tables in it are nested too deep"),
        ("[access]\ndefault = 'root'", "access.default must be one of none, observe, tune"),
        ("[access]\nobserve = 'alice'", "access.observe must be a list of users and @groups"),
        ("[access]\nobserve = ['a b']", "'a b' is neither a user nor a @group"),
        (
            "[access]\nobserve=['a']\nadmin=['a']",
            ":3: access.admin: a is already in access.observe",
        ),
        ("[access.default" + ".a" * 5000 + "]", "lists or tables in it are nested too deep"),
        ("[limits]\nclients = 0", ":2: limits.clients of 0 is out of range: 1 to 4096"),
        ("[limits]\nclients = 1.5", "limits.clients must be an integer"),
        ("[limits]\nclient = 1", 'unknown key "limits.client"; did you mean "clients"'),
    ],
)
def test_a_bad_file_is_rejected_by_name(tmp_path: Path, text: str, said: str) -> None:
    file = written(tmp_path, text)
    with pytest.raises(RequestError) as refused:
        settings_file.read(file)
    assert said in str(refused.value)
    assert str(file) in str(refused.value)


@pytest.mark.parametrize("number", ["1e400", "-1e400", "inf", "nan"])
@pytest.mark.parametrize(
    ("text", "key"),
    [
        (RULES + "most_per_s = ", "6: access.parameters[1].most_per_s"),
        ("[runner]\nfrequency_hz = ", "2: runner.frequency_hz"),
        ("[runner]\npriority = ", "2: runner.priority"),
        ("[limits]\nclients = ", "2: limits.clients"),
    ],
)
def test_an_invalid_number_is_rejected(tmp_path: Path, text: str, key: str, number: str) -> None:
    file = written(tmp_path, text + number)
    with pytest.raises(RequestError) as refused:
        settings_file.read(file)
    value = number.replace("1e400", "inf")
    assert str(refused.value) == f"{file}:{key} must be a finite number, not {value}"


@pytest.mark.parametrize(
    ("digits", "number"),
    [
        (401, "1" + "0" * 400),
        (5000, "-" + "9" * 5000),
        (5000, "9_" * 4999 + "9"),
        (9000, "0x" + "f" * 9000),
        (20000, "0b" + "1" * 20000),
    ],
    ids=lambda value: value if isinstance(value, int) else value[:4],
)
@pytest.mark.parametrize(
    "text",
    [
        RULES + "most_per_s = {}",
        "[runner]\nfrequency_hz = {}",
        "[runner]\npriority = {}",
        "[limits]\nclients = {}",
        "[access]\ntune = [[{}]]",
        "[daemon]\nsocket = {{a = {}}}",
    ],
)
def test_an_integer_beyond_64_bits_is_rejected_with_its_line(
    tmp_path: Path, text: str, digits: int, number: str
) -> None:
    file = written(tmp_path, text.format(number))
    with pytest.raises(RequestError) as refused:
        settings_file.read(file)
    said = str(refused.value)
    assert said.startswith(f"{file}:{len(text.splitlines())}: ")
    assert said.endswith("an integer does not fit into 64 bits")
    assert len(said) < len(str(file)) + 100 < digits


def test_a_file_that_is_no_text_is_rejected(tmp_path: Path) -> None:
    file = tmp_path / "rtcfd.toml"
    file.write_bytes("[runner]".encode("utf-16"))
    with pytest.raises(RequestError) as refused:
        settings_file.read(file)
    assert str(refused.value) == f"{file}: it is not UTF-8 text"


@pytest.mark.parametrize("odd", odd_files.ODD)
def test_anything_but_a_regular_file_is_rejected(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, odd: Callable[[Path], None]
) -> None:
    file = tmp_path / "rtcfd.toml"
    monkeypatch.setattr(settings_file, "DEFAULT_FILE", file)
    odd(file)
    lines: list[list[str]] = [[], ["--config", str(file)]]
    for line in lines:
        with odd_files.deadline(), pytest.raises(RequestError) as refused:
            options.parse(line, None)
        assert str(refused.value).startswith(f"cannot read {file}: ")
        assert "\n" not in str(refused.value)


def test_only_a_missing_file_means_the_defaults(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder, state = tmp_path / "rtcfd", tmp_path / "state"
    file = folder / "rtcfd.toml"
    state.mkdir()
    monkeypatch.setattr(settings_file, "DEFAULT_FILE", file)
    line = ["--state-dir", str(state)]
    assert options.parse(line, None).access == Access()
    folder.mkdir()
    assert options.parse(line, None).access == Access()
    file.write_text("[access]\ndefault = 'observe'\n")
    options.parse(line, None).settings.keep()
    file.unlink()
    odd_files.dangling(file)
    given = options.parse(line, None, last_good=True)
    assert given.access.default.word == "observe"
    assert given.settings.problem == (
        f"cannot read {file}: it is a symbolic link that leads nowhere; the last good settings are "
        "used instead"
    )
    # The same for a folder on the path to it.
    file.unlink()
    folder.rmdir()
    odd_files.dangling(folder)
    assert options.parse(line, None, last_good=True).access.default.word == "observe"


def test_a_byte_order_mark_is_skipped(tmp_path: Path) -> None:
    file = tmp_path / "rtcfd.toml"
    file.write_bytes("[runner]\nspin_us = 7\n".encode("utf-8-sig"))
    assert settings_file.read(file).runner.spin_us == 7


def test_a_missing_cpu_is_rejected() -> None:
    with pytest.raises(RequestError, match="CPU 4096"):
        runner_settings.check(runner_pb2.RunnerSettings(cpu=4096))
    runner_settings.check(runner_pb2.RunnerSettings(cpu=max(os.sched_getaffinity(0))))


def test_unspecified_leaves_a_setting_unchanged() -> None:
    base = runner_settings.defaults(runner_pb2.REALTIME_REQUIRED)
    change = runner_pb2.RunnerSettings(realtime=runner_pb2.REALTIME_UNSPECIFIED, spin_us=3)
    result = runner_settings.merged(base, change)
    assert (result.realtime, result.spin_us) == (runner_pb2.REALTIME_REQUIRED, 3)


def test_the_command_line_overrides_the_file(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    file = written(tmp_path, '[daemon]\nsocket = "/f"\npath = ["/f/lib"]\nrealtime = "required"')
    monkeypatch.setenv("RTCF_SOCKET", "/e")
    monkeypatch.setenv("CMAKE_PREFIX_PATH", "/ws/devel:/opt/ros")
    line = ["--foreground", "--config", str(file)]
    assert options.parse(line, None).socket == Path("/f")
    given = options.parse([*line, "--socket", "/o", "--path", "/o/lib"], Path("/build"))
    assert given.socket == Path("/o")
    assert given.runtime_dir == Path("/o.d")
    assert given.state_dir is None
    assert given.executor == Path("/build/bin/rtcf-executor")
    assert given.defaults.realtime == runner_pb2.REALTIME_REQUIRED
    assert [str(folder.path) for folder in given.folders[:5]] == [
        "/o/lib",
        "/f/lib",
        "/ws/devel/lib/rtcf-components",
        "/opt/ros/lib/rtcf-components",
        "/build/lib/rtcf",
    ]
    assert options.parse(["--foreground"], None).socket == Path("/e")


def test_the_service_uses_systemds_folder(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("STATE_DIRECTORY", "/var/lib/here")
    given = options.parse([], None)
    assert given.runtime_dir == Path("/run/rtcfd")
    assert given.state_dir == Path("/var/lib/here")
    assert given.defaults.realtime == runner_pb2.REALTIME_REQUIRED


def test_every_line_of_the_shipped_file_is_a_setting_that_is_accepted(tmp_path: Path) -> None:
    shipped = TREE / "systemd" / "rtcfd.toml"
    lines = [line[1:] if re.match(r"#([a-z_]+ = |\[[a-z.]+\]$)", line) else line
             for line in shipped.read_text().splitlines()]  # fmt: skip
    file = written(tmp_path, "\n".join(lines))
    found = settings_file.read(file)
    defaults = runner_settings.defaults(runner_pb2.REALTIME_REQUIRED)
    assert runner_settings.differences(runner_settings.completed(defaults), found.runner) == []
    assert (found.access, found.limits) == (Access(), Limits())
    known = {field.name for field in [*runner_pb2.RunnerSettings.DESCRIPTOR.fields,
                                      *runner_pb2.RosSettings.DESCRIPTOR.fields]}  # fmt: skip
    named = {line.partition(" =")[0] for line in lines}
    assert known - named == {"ros", "realtime"} - named


def test_a_block_can_be_appended_to_the_settings_as_shipped(tmp_path: Path) -> None:
    shipped = (TREE / "systemd" / "rtcfd.toml").read_text()
    file = tmp_path / "rtcfd.toml"
    file.write_text(f"{shipped}\n[access]\ndefault = 'observe'\n[runner]\nfrequency_hz = 20.0\n")
    found = settings_file.read(file)
    assert found.runner.frequency_hz == 20.0

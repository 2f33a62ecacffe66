"""rtcfctl: its messages, its formats, its exit codes."""

import json
import os
import re
import shutil
import signal
import socket
import subprocess
import sys
from pathlib import Path

import pytest
import rtcf
import yaml
from daemon_process import BUILD_TREE, signal_twice, wait_for
from daemon_under_test import DaemonUnderTest
from rtcf.v1 import graph_pb2, runner_pb2
from rtcfctl.loop.runner import settings_of
from rtcfctl.main import main, parser, verb_of
from rtcfctl.terminal.plain import plain


def test_a_session_with_text_output(daemon: DaemonUnderTest) -> None:
    steps = [
        ("runner set --frequency 2000 --no-ros", "runner rt_runner set\n"),
        ("load demo Fine --name a --remap in1:=/x", "loaded /a\n"),
        ("load demo Fine --name b --first", "loaded /b\n"),
        ("order", "/a\n/b\n"),
        ("break a.in1", "broken: a.in1\n"),
        ("set a k:=2", "set k:=2 of a\n"),
        ("start", "started\n"),
        ("stop", "stopped\n"),
        ("replace a demo Logs", "replaced a by /a\n"),
        ("unload a b", "unloaded a, b\n"),
        ("runner add arm", "runner arm added\n"),
        ("runner remove arm", "runner arm removed\n"),
    ]
    for command, answer in steps:
        done = daemon.ctl(*command.split())
        assert (done.stdout, done.stderr, done.returncode) == (answer, "", 0), command


def test_status_warns_of_loops_without_real_time(daemon: DaemonUnderTest) -> None:
    lines = daemon.ctl("status").stdout.splitlines()
    assert "!! rt_runner IS NOT REAL TIME:" in lines
    assert "!!   no permission for SCHED_FIFO" in lines


def test_tables_are_not_wrapped_without_a_terminal(daemon: DaemonUnderTest) -> None:
    name = "a" * 60
    daemon.ctl("load", "demo", "Fine", "--name", name, "--ignore", "[a-z]" * 30)
    table = daemon.ctl("list").stdout
    assert f"/{name}" in table
    assert "[a-z]" * 30 in table
    info = daemon.ctl("info", name).stdout
    assert "/a[1]" in info
    assert "2.5 ms" in info


@pytest.mark.parametrize(
    "command", ["status", "runner list", "list", "info a", "order", "connections", "types", "stats"]
)
def test_every_query_has_json_and_yaml_output(daemon: DaemonUnderTest, command: str) -> None:
    daemon.ctl("load", "demo", "Fine", "--name", "a")
    as_json = json.loads(daemon.ctl(*command.split(), "-o", "json").stdout)
    as_yaml = yaml.safe_load(daemon.ctl("-o", "yaml", *command.split()).stdout)
    assert type(as_json) is type(as_yaml)
    assert daemon.ctl(*command.split()).stdout


def test_a_type_is_described_without_loading_it(daemon: DaemonUnderTest) -> None:
    heading, *lines = daemon.ctl("info", "--type", "demo/Fine").stdout.splitlines()
    assert heading == "demo/Fine"
    assert any(line.split()[:2] == ["in1", "in"] for line in lines)
    assert any(line.split()[:2] == ["kp", "double"] for line in lines)
    as_json = json.loads(daemon.ctl("info", "--type", "demo/Fine", "-o", "json").stdout)
    assert (as_json["package"], as_json["type"]) == ("demo", "Fine")
    assert daemon.ctl("list", "-o", "json").stdout.strip() == "[]"


@pytest.mark.parametrize(
    ("words", "code", "text"),
    [
        ((), 2, "info: specify NAME or --type PKG/COMPONENT"),
        (("a", "--type", "demo/Fine"), 2, "info: specify NAME or --type PKG/COMPONENT"),
        (("--type", "Fine"), 2, "--type Fine: must be PKG/COMPONENT, e.g. rtcf_examples/Mimo"),
        (("--type", "demo/"), 2, "--type demo/: must be PKG/COMPONENT, e.g. rtcf_examples/Mimo"),
        (("--type", "a/b/c"), 2, "--type a/b/c: must be PKG/COMPONENT, e.g. rtcf_examples/Mimo"),
        (("--type", "demo/Fin"), 1, 'no type "Fin" in package "demo"; did you mean "Fine"?'),
        (("--type", "dem/Fine"), 1, 'no package "dem" with component libraries in'),
    ],
)
def test_a_type_that_does_not_exist_is_one_line(
    daemon: DaemonUnderTest, words: tuple[str, ...], code: int, text: str
) -> None:
    done = daemon.ctl("info", *words)
    assert (done.returncode, done.stdout) == (code, "")
    assert done.stderr.startswith(f"rtcfctl: {text}") and done.stderr.count("\n") == 1


def test_an_error_is_one_line_and_exit_code_1(daemon: DaemonUnderTest) -> None:
    done = daemon.ctl("load", "demo", "Refused")
    assert (done.returncode, done.stdout) == (1, "")
    assert done.stderr == "rtcfctl: Refused.configure failed\n"


def test_ctrl_c_is_exit_code_1_and_the_operation_continues(
    daemon: DaemonUnderTest, client: rtcf.Client, tmp_path: Path
) -> None:
    go_on = tmp_path / "go on"
    with subprocess.Popen(
        [str(BUILD_TREE / "bin" / "rtcfctl"), "-v", "load", "demo", "Slow",
         "--param", f"until:={go_on}"],
        env={**os.environ, "RTCF_SOCKET": str(daemon.socket)}, stderr=subprocess.PIPE, text=True,
    ) as process:  # fmt: skip
        assert process.stderr is not None
        assert any("configuring Slow" in line for line in process.stderr)
        signal_twice(process, signal.SIGINT)
        said = process.stderr.read()
        assert process.wait() == 1
    assert said == "rtcfctl: interrupted; a change that had started continues\n"
    go_on.touch()
    wait_for(lambda: client.get_order() == ["/Slow"], "the component")


@pytest.mark.parametrize(
    "command",
    ["load demo", "nonsense", "break a", "set a k", "runner set", "load demo Fine --remap a"],
)
def test_bad_usage_is_exit_code_2(stopped_daemon: DaemonUnderTest, command: str) -> None:
    assert stopped_daemon.ctl(*command.split()).returncode == 2


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["stauts"], 'no command "stauts"; did you mean "stats" or "status"?; `rtcfctl --help`'),
        (["-v", "--socket", "s", "qq"], 'no command "qq"; `rtcfctl --help` lists all'),
        (["help", "stpo"], 'no command "stpo"; did you mean "stop" or "step"?'),
    ],
)
def test_a_misspelt_command_is_reported_with_similar_ones(
    capsys: pytest.CaptureFixture[str], words: list[str], said: str
) -> None:
    assert main(words) == 2
    line = capsys.readouterr().err
    assert line.startswith(f"rtcfctl: {said}") and line.count("\n") == 1


def test_a_bag_is_not_written_under_the_name_of_another_format(
    capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    assert main(["replay", "in.bag", "--write", str(tmp_path / "out.mcap")]) == 2
    assert f"the outputs are a bag: name it {tmp_path}/out.bag" in capsys.readouterr().err


@pytest.mark.parametrize("words", [["help", "status"], ["help"]])
def test_help_shows_the_options_of_a_command(
    capsys: pytest.CaptureFixture[str], words: list[str]
) -> None:
    shown = []
    for line in (words, [*words[1:], "--help"]):
        with pytest.raises(SystemExit, match="^0$"):
            main(line)
        shown.append(capsys.readouterr().out)
    assert shown[0] == shown[1] and shown[0].startswith("usage: rtcfctl")


def test_no_daemon_is_exit_code_3(stopped_daemon: DaemonUnderTest) -> None:
    done = stopped_daemon.ctl("status")
    assert done.returncode == 3
    assert str(stopped_daemon.socket) in done.stderr
    assert "systemctl start rtcfd" in done.stderr
    assert done.stderr.count("\n") == 1


def test_a_too_long_socket_path_is_reported_in_one_line() -> None:
    path = f"/tmp/{'x' * 120}"
    done = subprocess.run(
        [str(BUILD_TREE / "bin" / "rtcfctl"), "--socket", path, "status"],
        capture_output=True, text=True, check=False,
    )  # fmt: skip
    said = f"rtcfctl: {path} is longer than the 107 characters of a unix socket's path\n"
    assert (done.returncode, done.stdout, done.stderr) == (3, "", said)


@pytest.mark.skipif(os.geteuid() != 0, reason="requires root to act as another user")
@pytest.mark.parametrize(
    ("mode", "group", "advice"),
    [
        (0o660, "daemon", "join its group (`sudo adduser nobody daemon`) and log in again"),
        # No group grants access to more than this socket, or to nothing.
        (0o660, "root", "it belongs to the private rtcfd of user root"),
        (0o600, "daemon", "it belongs to the private rtcfd of user root"),
    ],
)
def test_no_permission_is_exit_code_3_and_names_the_group(
    stopped_daemon: DaemonUnderTest, mode: int, group: str, advice: str
) -> None:
    # A user with access to all folders, including those above the build tree and the socket.
    nobody = ["--reuid=65534", "--regid=65534", "--clear-groups"]
    looks = ["--inh-caps=+dac_read_search", "--ambient-caps=+dac_read_search"]
    with socket.socket(socket.AF_UNIX) as listening:
        listening.bind(str(stopped_daemon.socket))
        listening.listen()
        shutil.chown(stopped_daemon.socket, group=group)
        stopped_daemon.socket.chmod(mode)
        done = stopped_daemon.ctl("status", wrapper=["setpriv", *nobody, *looks])
    assert done.stderr.endswith(f": permission denied on {stopped_daemon.socket}: {advice}\n")
    assert done.returncode == 3


def test_ctrl_c_during_imports_ends_it_silently(tmp_path: Path) -> None:
    script = tmp_path / "bin" / "rtcfctl"
    module = tmp_path / "python" / "rtcfctl" / "main.py"
    for file in (script, module):
        file.parent.mkdir(parents=True)
    shutil.copy(BUILD_TREE / "bin" / "rtcfctl", script)
    module.write_text("import os, signal\nos.kill(os.getpid(), signal.SIGINT)\nmain = print\n")
    done = subprocess.run([str(script)], capture_output=True, text=True, check=False)
    assert (done.returncode, done.stdout, done.stderr) == (-signal.SIGINT, "", "")


def test_ctrl_c_while_python_starts_ends_it_silently(tmp_path: Path) -> None:
    """Python handles the signal some time before it reads the script."""
    command = [str(BUILD_TREE / "bin" / "rtcfctl"), "--socket", str(tmp_path / "s")]
    for _ in range(50):
        with subprocess.Popen(
            [*command, "status"], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
        ) as process:
            while not (handles := _handles_ctrl_c(process.pid)) and process.poll() is None:
                pass
            if not handles:
                continue
            process.send_signal(signal.SIGSTOP)
            found = os.waitid(os.P_PID, process.pid, os.WSTOPPED | os.WEXITED | os.WNOWAIT)
            early = (
                found is not None
                and found.si_code == os.CLD_STOPPED
                and _handles_ctrl_c(process.pid)
                and "grpc" not in Path(f"/proc/{process.pid}/maps").read_text()
            )
            process.send_signal(signal.SIGINT)
            process.send_signal(signal.SIGCONT)
            said = process.communicate()
        if early:
            assert (process.returncode, *said) == (-signal.SIGINT, "", "")
            return
    pytest.fail("rtcfctl could not be stopped while Python starts")


def _handles_ctrl_c(pid: int) -> bool:
    (caught,) = re.findall(r"SigCgt:\s+(\w+)", Path(f"/proc/{pid}/status").read_text())
    return bool(int(caught, 16) & 1 << (signal.SIGINT - 1))


# A second Ctrl-C while the first one is handled, and one between the end of rtcfctl and the end
# of Python.
LATE = {
    "the second": "main._fail = main.rtcf.Client = interrupt\n",
    "the last moment": "atexit.register(interrupt)\n",
}


@pytest.mark.parametrize("when", LATE)
def test_ctrl_c_at_the_end_prints_no_traceback(tmp_path: Path, when: str) -> None:
    command = str(BUILD_TREE / "bin" / "rtcfctl")
    program = (
        "import atexit, os, runpy, signal, sys\n"
        f"sys.path.insert(0, {str(BUILD_TREE / 'python')!r})\n"
        "from rtcfctl import main\n"
        "interrupt = lambda *_: os.kill(os.getpid(), signal.SIGINT)\n"
        f"sys.argv = [{command!r}, '--socket', {str(tmp_path / 'none')!r}, 'status']\n"
        f"{LATE[when]}"
        f"runpy.run_path({command!r}, run_name='__main__')\n"
    )
    done = subprocess.run(
        [sys.executable, "-c", program], capture_output=True, text=True, check=False
    )
    assert done.returncode == -signal.SIGINT
    assert "Traceback" not in done.stderr and "KeyboardInterrupt" not in done.stderr


def test_ctrl_c_in_an_import_takes_effect_after_the_import(tmp_path: Path) -> None:
    """An exception raised there would be lost, or reported as a missing module."""
    command = str(BUILD_TREE / "bin" / "rtcfctl")
    program = (
        "import os, runpy, signal, sys\n"
        f"sys.path.insert(0, {str(BUILD_TREE / 'python')!r})\n"
        "class Finder:\n"
        "    def find_spec(self, name, path, target=None):\n"
        "        if name != 'wave':\n"
        "            return\n"
        "        try:\n"
        "            os.kill(os.getpid(), signal.SIGINT)\n"
        "            for each in range(1000): pass\n"
        "        except KeyboardInterrupt:\n"
        "            raise ImportError('lost')\n"
        "sys.meta_path.insert(0, Finder())\n"
        "import rtcf\n"
        "class Client(rtcf.Client):\n"
        "    def __enter__(self):\n"
        "        import wave\n"
        "        return super().__enter__()\n"
        "rtcf.Client = Client\n"
        f"sys.argv = [{command!r}, '--socket', {str(tmp_path / 'none')!r}, 'status']\n"
        f"runpy.run_path({command!r}, run_name='__main__')\n"
    )
    done = subprocess.run(
        [sys.executable, "-c", program], capture_output=True, text=True, check=False
    )
    assert "lost" not in done.stderr and "Traceback" not in done.stderr, done.stderr
    assert done.stderr.startswith("rtcfctl: ")
    assert done.returncode in (1, 3)  # interrupted, or after the error: no daemon


def test_options_set_exactly_their_settings() -> None:
    line = "runner set --cpu -1 --spin 5 --overrun catch_up --no-lock-memory --whitelist a"
    args = parser().parse_args(line.split())
    expected = runner_pb2.RunnerSettings(
        cpu=-1,
        spin_us=5,
        overrun=runner_pb2.OVERRUN_POLICY_CATCH_UP,
        lock_memory=False,
        ros=runner_pb2.RosSettings(whitelist="a"),
    )
    assert settings_of(args) == expected


def test_global_options_can_precede_or_follow_the_verb() -> None:
    before = parser().parse_args(["-r", "arm", "-o", "json", "order"])
    after = parser().parse_args(["order", "-r", "arm", "-o", "json"])
    assert (before.runner, before.output) == (after.runner, after.output) == ("arm", "json")


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("1e3", 1000.0),
        ("-7", -7),
        ("1e400", "1e400"),
        ("[1, -1e999]", [1, "-1e999"]),
        ("9" * 5000, "9" * 5000),
    ],
    ids=["float", "integer", "infinite", "infinite in a list", "too many digits"],
)
def test_port_values_are_valid_json(text: str, value: object) -> None:
    found = plain(graph_pb2.PortInfo(value=text))["value"]
    assert found == value
    json.dumps(found, allow_nan=False)


def test_plain_has_numbers_short_words_and_nulls() -> None:
    status = runner_pb2.RunnerStatus(
        state=runner_pb2.RUNNER_STATE_RUNNING,
        iteration=2**60,
        settings=runner_pb2.RunnerSettings(overrun=runner_pb2.OVERRUN_POLICY_CATCH_UP),
    )
    result = plain(status)
    assert (result["state"], result["iteration"]) == ("running", 2**60)
    assert result["settings"]["overrun"] == "catch_up"
    assert result["settings"]["cpu"] is None
    assert plain(rtcf.parse_value(".nan")) == "nan"


def test_statistics_can_be_watched_as_text(daemon: DaemonUnderTest, client: rtcf.Client) -> None:
    watched = client.watch_statistics(interval_s=0.1)
    assert [next(watched).iterations for _ in range(3)] == [10, 10, 10]
    with pytest.raises(rtcf.RefusedError, match='no runner "nobody"'):
        next(client.watch_statistics("nobody"))
    assert daemon.ctl("stats", "--watch", "0").returncode == 2


def test_watched_statistics_are_documents_until_ctrl_c(daemon: DaemonUnderTest) -> None:
    with daemon.ctl_process("stats", "--watch", "0.1", "-o", "yaml") as process:
        assert process.stdout is not None
        text = ""
        while text.count("---") < 3:
            text += process.stdout.readline()
        process.send_signal(signal.SIGINT)
        text += process.stdout.read()
        assert process.wait() == 0
    assert [each["iterations"] for each in yaml.safe_load_all(text)][:2] == [10, 10]


def test_a_call_imports_only_the_modules_of_its_verb(tmp_path: Path) -> None:
    script = (
        "import sys; from rtcfctl.main import main;"
        f"main(['--socket', {str(tmp_path / 'none')!r}, 'status']); print(*sys.modules)"
    )
    done = subprocess.run(
        [sys.executable, "-c", script], cwd=BUILD_TREE / "python", capture_output=True, text=True,
        check=True,
    )  # fmt: skip
    loaded = set(done.stdout.split())
    assert "rtcfctl.loop.status" in loaded
    for heavy in ("rich", "yaml", "difflib", "rtcf.replay", "rtcf_shared.graph_reader"):
        assert heavy not in loaded, heavy
    assert not {"rtcfctl.machine.doctor", "rtcfctl.machine.check", "rtcfctl.completion"} & loaded


@pytest.mark.parametrize("words", [["--help"], ["__complete", "st"]])
def test_help_and_completion_import_no_large_library(words: list[str]) -> None:
    script = (
        "import contextlib, io, sys; from rtcfctl.main import main\n"
        "with contextlib.redirect_stdout(io.StringIO()), contextlib.suppress(SystemExit):\n"
        f"    main({words!r})\n"
        "print(*sys.modules)"
    )
    done = subprocess.run(
        [sys.executable, "-c", script], cwd=BUILD_TREE / "python", capture_output=True, text=True,
        check=True,
    )  # fmt: skip
    loaded = set(done.stdout.split())
    assert {"rtcfctl.control.tune", "rtcfctl.signals.scope"} <= loaded
    assert not {"numpy", "scipy", "matplotlib", "aiohttp", "rich", "yaml"} & loaded


@pytest.mark.parametrize(
    "line", ["status", "-r stats load a b", "--socket x -v -o json stop", "--output=yaml info a"]
)
def test_the_verb_is_found_among_global_options(line: str) -> None:
    words = line.split()
    whole = parser().parse_args(words)
    assert vars(parser(verb_of(words)).parse_args(words)) == vars(whole)


def test_each_verb_is_in_its_listed_module() -> None:
    (whole,) = (each for each in parser()._actions if isinstance(each.choices, dict))
    assert isinstance(whole.choices, dict)
    for verb in whole.choices:
        found = (each for each in parser(verb_of([verb]))._actions if each.choices)
        assert any(verb in (each.choices or ()) for each in found), verb


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ("step 99999999999999999999", "at most 1000000000000000000 cycles"),
        ("load demo Fine --every -1", "-1: use a whole number from 0 to 4294967295"),
        ("load demo Fine --phase 99999999999", "99999999999: use a whole number from 0 to"),
        ("echo --rate=-5", "--rate -5: 0 Hz or more"),
        ("echo --rate nan", "--rate nan: 0 Hz or more"),
        ("record -o x.mcap --duration 1e300", "--duration 1e+300: more than 0 s, and 1e+09 at"),
        ("stats --watch inf", "--watch inf: at least 0.1 s, at most 86400"),
    ],
)
def test_a_number_out_of_range_is_reported_with_its_option(
    daemon: DaemonUnderTest, words: str, said: str
) -> None:
    done = daemon.ctl(*words.split())
    assert done.returncode == 2
    assert said in done.stderr.splitlines()[-1]


@pytest.mark.parametrize("words", ["status", "-o json status", "stats --watch 0.1", "save"])
def test_output_to_a_full_disk_is_reported_in_one_line(daemon: DaemonUnderTest, words: str) -> None:
    with open("/dev/full", "w") as full:
        done = subprocess.run(
            [BUILD_TREE / "bin" / "rtcfctl", "--socket", daemon.socket, *words.split()],
            stdout=full,
            stderr=subprocess.PIPE,
            text=True,
            timeout=60,
        )
    said = "rtcfctl: standard output: No space left on device\n"
    assert (done.returncode, done.stderr) == (1, said)


@pytest.mark.parametrize(
    "line",
    ["restart rt_runner", "remove rt_runner", "set rt_runner --frequency 7", "add rt_runner"],
)
def test_a_line_names_one_runner(daemon: DaemonUnderTest, line: str) -> None:
    pid = daemon.executor_pid()
    for runner in ("nope", "nope --socket " + str(daemon.socket)):
        done = daemon.ctl("-r", *runner.split(), "runner", *line.split())
        assert (done.returncode, done.stderr) == (
            2,
            "rtcfctl: -r nope and rt_runner: specify one runner\n",
        )
    assert daemon.executor_pid() == pid
    assert daemon.ctl("-r", "rt_runner", "runner", "restart", "rt_runner").returncode == 0

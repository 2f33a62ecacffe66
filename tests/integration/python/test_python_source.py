"""Python sources given to rtcfctl: compiled, cached, and swapped in when saved."""

import importlib.machinery
import importlib.util
import json
import os
import platform
import re
import select
import shutil
import subprocess
import threading
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

import pytest
import rtcf
import yaml
from daemon_process import BUILD_TREE, DEADLINE_S, Daemon, wait_for
from processor_time import descendants
from rtcfctl.graph import python_source, source_files
from values import parameter_values, port_value

COMPILE_DEADLINE_S = 900.0


@pytest.fixture
def own_cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Set a private cache for rtcfctl and rtcfd."""
    cache = tmp_path / "cache"
    monkeypatch.setenv("XDG_CACHE_HOME", str(cache))
    return cache


@pytest.fixture
def daemon(tmp_path: Path, own_cache: Path) -> Iterator[Daemon]:
    """Yield an rtcfd that uses this cache."""
    daemon = Daemon(tmp_path)
    daemon.start()
    yield daemon
    if not daemon.ended:
        daemon.end()


def _states(client: rtcf.Client) -> dict[str, str]:
    return {each.name: each.value for each in client.get_component("Counts").states}


COUNTS = """\
from rtcf.component import Component, Output, State


class Counts(Component):
    out: Output[int]
    count: State[int]

    def update(self):
        self.count += STEP
        self.out.write(self.count)
"""


# Python's ints are unbounded, the loop's have 64 bits.
OVERFLOW = "1 + self.count * 10**18 % 7"
TUNED = """\
from rtcf.component import Component, Output, Parameter


class Tuned(Component):
    kp: Parameter[float] = Parameter({kp}, min=0.0, max={most})
    ki: Parameter[float] = Parameter({ki})
    out: Output[float]

    def update(self):
        self.out.write(self.kp + self.ki)
"""


class Watching:
    """`rtcfctl load --watch`, and its output."""

    def __init__(self, daemon: Daemon, *words: str) -> None:
        self._said = daemon.folder / "said"
        with self._said.open("wb") as to:
            self._process = subprocess.Popen(
                [str(BUILD_TREE / "bin" / "rtcfctl"), "load", *words, "--watch"],
                env=daemon.environment(),
                stdout=to,
                stderr=to,
            )

    def __enter__(self) -> "Watching":
        return self

    def __exit__(self, *_: object) -> None:
        self._process.terminate()
        self._process.wait(60)

    @property
    def said(self) -> str:
        return self._said.read_text()

    def wait_for(self, text: str, times: int = 1) -> None:
        wait_for(lambda: self.said.count(text) >= times, text, COMPILE_DEADLINE_S)


def _history(client: rtcf.Client) -> list[tuple[str, str, object]]:
    return [
        (each.how, each.parameter, getattr(each.value, each.value.WhichOneof("kind")))
        for each in client.get_history("Tuned")
    ]


def _errors(said: str) -> str:
    """Return standard error without the line that announces a compilation."""
    return re.sub(r"^compiling .* …\n", "", said)


def _save(source: Path, text: str) -> None:
    """Replace the file at once: each partial write would be swapped in."""
    part = source.with_suffix(".part")
    part.write_text(text)
    part.replace(source)


def test_tuned_values_stay_when_a_source_is_saved(
    tmp_path: Path, daemon: Daemon, client: rtcf.Client
) -> None:
    source = tmp_path / "tuned.py"
    _save(source, TUNED.format(kp=1.0, most=100.0, ki=0.25))
    with Watching(daemon, str(source), "Tuned", "--param", "ki:=0.5") as watching:
        watching.wait_for("loaded /Tuned")
        assert parameter_values(client, "Tuned") == {"kp": 1.0, "ki": 0.5}
        assert daemon.ctl("set", "Tuned", "kp:=50").returncode == 0
        # A new default of a tuned or given parameter changes nothing.
        _save(source, TUNED.format(kp=2.0, most=90.0, ki=0.75))
        watching.wait_for("reloaded /Tuned")
        assert f"reloaded /Tuned from {source}; kept kp 50\n" in watching.said
        assert parameter_values(client, "Tuned") == {"kp": 50.0, "ki": 0.5}
        history = [("load", "ki", 0.5), ("set", "kp", 50.0)]
        assert _history(client) == history, "a save sets nothing"
        assert daemon.ctl("undo", "Tuned").returncode == 0
        assert parameter_values(client, "Tuned")["kp"] == 1.0
        assert daemon.ctl("set", "Tuned", "kp:=50", "ki:=3").returncode == 0
        history += [("undo", "kp", 1.0), ("set", "kp", 50.0), ("set", "ki", 3.0)]
        _save(source, TUNED.format(kp=3.0, most=9.0, ki=0.75))
        watching.wait_for("reloaded /Tuned", 2)
        note = "rtcfctl: note: /Tuned: kp = 50.0 does not fit: 0 to 9; it is 3.0 now\n"
        assert watching.said.count(note) == 1
        assert parameter_values(client, "Tuned") == {"kp": 3.0, "ki": 3.0}
        history += [("replace", "kp", 3.0)]
        assert _history(client) == history
        # The parameter was not tuned, so its default applies.
        _save(source, TUNED.format(kp=4.0, most=9.0, ki=1.0))
        watching.wait_for("reloaded /Tuned", 3)
        assert parameter_values(client, "Tuned")["kp"] == 4.0
        assert _history(client)[: len(history)] == history


def test_code_that_differs_from_the_interpreter_is_rejected_by_default(
    tmp_path: Path, daemon: Daemon, client: rtcf.Client
) -> None:
    source = tmp_path / "counts.py"
    source.write_text(COUNTS.replace("STEP", OVERFLOW))
    for _ in range(2):
        done = daemon.ctl("load", str(source), "Counts")
        assert done.returncode == 1
        assert re.fullmatch(
            rf"rtcfctl: {source}: Counts: update, cycle \d+: \w+ is -?\d+ compiled, -?\d+ in "
            rf"the interpreter; `rtcf-compile {source} --verify` shows details, --no-verify "
            rf"skips this\n",
            _errors(done.stderr),
        ), done.stderr
        # A library loaded with --no-verify is not trusted later.
        assert daemon.ctl("load", str(source), "Counts", "--no-verify").returncode == 0
        client.unload(["Counts"])


def test_an_rtcfd_that_does_not_search_the_cache_names_the_remedy(
    tmp_path: Path, daemon: Daemon, client: rtcf.Client, monkeypatch: pytest.MonkeyPatch
) -> None:
    source = tmp_path / "counts.py"
    source.write_text(COUNTS.replace("STEP", "1"))
    client.load(rtcf.component("rtcf_examples", "Identity", name="I"))
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "other"))
    for verb in (["load"], ["replace", "I"]):
        done = daemon.ctl(*verb, str(source), "Counts")
        assert done.returncode == 1
        assert re.fullmatch(
            r'rtcfctl: no package "counts_\w+" with component libraries in .+: only a private '
            rf"rtcfd with the same cache folder searches {tmp_path}/other/rtcf-components, as "
            r"that of `rtcfctl run`; for this rtcfd, compile into one of its folders: "
            rf"`rtcf-compile {source} -o FOLDER/PACKAGE/NAME\.so`\n",
            _errors(done.stderr),
        ), done.stderr
    assert client.get_order() == ["/I"]


def test_a_saved_source_that_differs_does_not_change_the_loop(
    tmp_path: Path, daemon: Daemon, client: rtcf.Client
) -> None:
    source = tmp_path / "counts.py"
    source.write_text(COUNTS.replace("STEP", "1"))
    with Watching(daemon, str(source), "Counts") as watching:
        watching.wait_for("loaded /Counts")
        client.step(10)
        source.write_text(COUNTS.replace("STEP", OVERFLOW))
        watching.wait_for("--no-verify skips this")
        client.step(10)
        assert _states(client) == {"count": "20"}
        endless = "1\n        while self.count > 0:\n            self.count += 1"
        source.write_text(COUNTS.replace("STEP", endless))
        watching.wait_for(
            f"rtcfctl: {source}:10: `while self.count > 0:`: Counts: update, cycle 0: it did not "
            "end within 2 s"
        )
        source.write_text(COUNTS.replace("STEP", "1 // (0 * self.count)"))
        watching.wait_for("cycles with random inputs: ZeroDivisionError")
        assert re.search(
            rf"\nrtcfctl: {source}:9: `.*`: Counts: update raises in each of \d+ cycles .*, "
            r"--no-verify skips this\n",
            watching.said,
        ), watching.said
        client.step(10)
        assert _states(client) == {"count": "30"}
        source.write_text(COUNTS.replace("STEP", "1000"))
        watching.wait_for("reloaded /Counts")
        client.step(1)
        assert _states(client) == {"count": "1030"}


def test_a_state_made_private_keeps_its_value_and_its_snapshots(
    tmp_path: Path, daemon: Daemon, client: rtcf.Client
) -> None:
    source, snapshot = tmp_path / "counts.py", str(tmp_path / "snapshot")
    plain = COUNTS.replace("STEP", "1")
    _save(source, plain)
    with Watching(daemon, str(source), "Counts") as watching:
        watching.wait_for("loaded /Counts")
        client.step(10)
        assert daemon.ctl("snapshot", snapshot).returncode == 0
        client.step(10)
        _save(source, plain.replace(" count:", " _count:").replace("self.count", "self._count"))
        watching.wait_for("reloaded /Counts")
        client.step(1)
        assert _states(client) == {"count": "21"}
        done = daemon.ctl("restore", snapshot)
        assert done.returncode == 0, done.stderr
        client.step(1)
        assert _states(client) == {"count": "11"}


@pytest.fixture
def calls(tmp_path: Path, own_cache: Path) -> Path:
    """Return a file that lists the calls of a compiler of the build tree `tmp_path`."""
    file = tmp_path / "calls"
    compiler = tmp_path / "bin" / "rtcf-compile"
    compiler.parent.mkdir()
    compiler.write_text(
        f'#!/bin/sh\necho "$@" >> {file}\nfor library; do :; done\n'
        'case $* in *-o*) mkdir -p "${library%/*}"; touch "$library";; esac\n'
    )
    compiler.chmod(0o755)
    return file


def test_a_library_is_verified_once(tmp_path: Path, calls: Path) -> None:
    source = tmp_path / "counts.py"
    source.write_text(COUNTS)

    def called(verify: bool) -> list[str]:
        before = calls.read_text().splitlines() if calls.exists() else []
        python_source.compiled(str(source), tmp_path, lambda line: None, verify)
        lines = calls.read_text().splitlines()[len(before) :]
        return [re.sub(r"\S+/|--depfile \S+ ?", "", line).strip() for line in lines]

    assert called(verify=False) == ["counts.py -o counts.so"]
    assert called(verify=False) == []
    assert called(verify=True) == ["counts.py --verify 1s"], "the library exists already"
    assert called(verify=True) == called(verify=False) == []
    source.write_text(COUNTS + "\n")
    assert called(verify=True) == ["counts.py --verify 1s -o counts.so"]
    assert called(verify=True) == called(verify=False) == []


def test_a_source_is_loaded_cached_and_swapped_in_when_saved(
    own_cache: Path, tmp_path: Path, daemon: Daemon, client: rtcf.Client
) -> None:
    source = tmp_path / "counts.py"
    source.write_text(COUNTS.replace("STEP", "1"))
    said = tmp_path / "said"
    with said.open("wb") as to:
        watching = subprocess.Popen(
            [str(BUILD_TREE / "bin" / "rtcfctl"), "load", str(source), "Counts", "--watch"],
            env=daemon.environment(),
            stdout=to,
            stderr=to,
        )
    try:
        wait_for(lambda: client.get_order() == ["/Counts"], "the component", COMPILE_DEADLINE_S)
        client.step(10)
        assert _states(client) == {"count": "10"}
        (library,) = own_cache.glob("rtcf-components/counts_*/counts.so")
        first = library.stat().st_mtime_ns
        source.write_text(COUNTS.replace("STEP", "1 + ["))
        wait_for(lambda: "counts.py:9: " in said.read_text(), "the line", COMPILE_DEADLINE_S)
        client.step(10)
        assert _states(client) == {"count": "20"}
        source.write_text(COUNTS.replace("STEP", "1000"))
        wait_for(lambda: "reloaded /Counts" in said.read_text(), "the swap", COMPILE_DEADLINE_S)
        client.step(1)
        assert _states(client) == {"count": "1020"}
        assert library.stat().st_mtime_ns > first
    finally:
        watching.terminate()
        watching.wait(60)
    client.unload(["Counts"])
    second = library.stat().st_mtime_ns
    done = daemon.ctl("load", str(source), "Counts")
    assert done.returncode == 0, done.stderr
    assert library.stat().st_mtime_ns == second


def test_a_compilation_is_announced_at_once(
    tmp_path: Path, daemon: Daemon, client: rtcf.Client
) -> None:
    source, fifo = tmp_path / "counts.py", tmp_path / "fifo"
    os.mkfifo(fifo)
    # The compilation waits until the test has read the line.
    source.write_text(f"open({str(fifo)!r}).read()\n{COUNTS.replace('STEP', '1')}")
    loading = subprocess.Popen(
        [str(BUILD_TREE / "bin" / "rtcfctl"), "-o", "json", "load", str(source), "Counts"],
        env=daemon.environment(), stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
    )  # fmt: skip
    assert loading.stderr is not None
    assert loading.stderr.readline() == f"compiling {source} …\n"
    fifo.write_text("")
    said, errors = loading.communicate(timeout=COMPILE_DEADLINE_S)
    # On a slow machine, rtcfctl prints the steps of a change.
    steps = {"loading /Counts", "configuring /Counts", "adopting the change"}
    assert loading.returncode == 0
    assert set(errors.splitlines()) <= steps
    assert json.loads(said)["component"] == "/Counts"
    client.unload(["Counts"])
    done = daemon.ctl("load", str(source), "Counts")
    assert done.returncode == 0
    assert set(done.stderr.splitlines()) <= steps, "the library is in the cache"


def test_all_errors_of_a_source_are_shown(
    tmp_path: Path, daemon: Daemon, client: rtcf.Client
) -> None:
    source = tmp_path / "counts.py"
    wrong = COUNTS.replace("STEP", "1 + absent") + "        print(self.count)\n"
    source.write_text(wrong)
    errors = [
        rf"{source}:9: `absent`: absent is not defined: .*",
        rf"{source}:11: `print\(self\.count\)`: printing calls the system: .*",
    ]
    expected = "".join(f"rtcfctl: {each}\n" for each in errors)
    done = daemon.ctl("load", str(source), "Counts")
    assert done.returncode == 1
    assert re.fullmatch(f"compiling {source} …\n{expected}", done.stderr), done.stderr
    source.write_text(COUNTS.replace("STEP", "1"))
    with Watching(daemon, str(source), "Counts") as watching:
        watching.wait_for("loaded /Counts")
        source.write_text(wrong)
        watching.wait_for("printing calls the system")
        assert re.search(expected, watching.said), watching.said
        client.step(10)
        assert _states(client) == {"count": "10"}


def _workers() -> list[int]:
    found = descendants(os.getpid())
    return [each for each in found if b"--worker" in Path(f"/proc/{each}/cmdline").read_bytes()]


def test_a_watched_source_is_compiled_by_one_worker(
    tmp_path: Path, daemon: Daemon, client: rtcf.Client
) -> None:
    source = tmp_path / "counts.py"
    source.write_text(COUNTS.replace("STEP", "1"))
    with Watching(daemon, str(source), "Counts") as watching:
        watching.wait_for("loaded /Counts")
        workers = _workers()
        assert len(workers) == 1
        for number in (1, 2):
            _save(source, COUNTS.replace("STEP", f"{number}0"))
            watching.wait_for("reloaded /Counts", number)
        assert _workers() == workers
        end = os.pidfd_open(workers[0])
    assert select.select([end], [], [], DEADLINE_S)[0]


def test_files_that_a_source_reads_are_watched(
    tmp_path: Path, daemon: Daemon, client: rtcf.Client
) -> None:
    source, table, module = (
        tmp_path / "own" / "counts.py", tmp_path / "table 1.txt", tmp_path / "shared" / "gains.py"
    )  # fmt: skip
    for each in (source, module):
        each.parent.mkdir()
    table.write_text("1 2\n")
    module.write_text("GAIN = 100\n")
    head = (
        "import sys\n\nimport numpy as np\n\n"
        f"sys.path.append({str(module.parent)!r})\nfrom gains import GAIN\n"
        f"STEP = GAIN * int(np.loadtxt({str(table)!r})[1])\n"
    )
    source.write_text(head + COUNTS)
    with Watching(daemon, str(source), "Counts") as watching:
        watching.wait_for("loaded /Counts")
        client.step(1)
        assert _states(client) == {"count": "200"}
        _save(table, "1 3\n")
        watching.wait_for("reloaded /Counts", 1)
        client.step(1)
        assert _states(client) == {"count": "500"}
        _save(module, "GAIN = 1000\n")
        watching.wait_for("reloaded /Counts", 2)
        client.step(1)
        assert _states(client) == {"count": "3500"}
    client.unload(["Counts"])
    table.write_text("1 4\n")
    assert daemon.ctl("load", str(source), "Counts").returncode == 0
    client.step(1)
    assert _states(client) == {"count": "4000"}


def test_a_file_that_changes_while_it_is_compiled_is_compiled_again(
    tmp_path: Path, own_cache: Path
) -> None:
    source, table = tmp_path / "counts.py", tmp_path / "table.txt"
    table.write_text("1\n")
    source.write_text(f"STEP = int(open({str(table)!r}).read())\n{COUNTS}")
    calls = []

    class Compiler:
        def run(
            self, arguments: Sequence[str], progress: Callable[[str], None]
        ) -> tuple[int, list[str]]:
            words = list(arguments)
            calls.append(words)
            if len(calls) < 3:
                table.write_text(f"{len(calls) + 1}\n")
            library, rule = Path(words[-1]), Path(words[words.index("--depfile") + 1])
            library.parent.mkdir(parents=True, exist_ok=True)
            library.touch()
            rule.write_text(f"{library}: {source} {table}\n")
            return 0, []

    def compiled() -> int:
        before = len(calls)
        python_source.compiled(str(source), BUILD_TREE, lambda line: None, False, Compiler())
        return len(calls) - before

    assert compiled() == 3
    assert compiled() == 0
    table.write_text("9\n")
    assert compiled() == 1
    table.write_text("3\n")
    assert compiled() == 1


def test_a_save_during_compilation_is_noticed(tmp_path: Path) -> None:
    source = tmp_path / "counts.py"
    source.write_text(COUNTS)
    changes = python_source.changes(str(source))
    source.write_text(COUNTS + "\n")
    seeing = threading.Thread(target=lambda: next(saved for saved in changes if saved), daemon=True)
    seeing.start()
    seeing.join(DEADLINE_S)
    assert not seeing.is_alive()


def test_a_library_of_another_debian_is_recompiled(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    source = tmp_path / "counts.py"
    source.write_text(COUNTS)
    ours = source_files.fingerprint(source)
    assert source_files.fingerprint(source) == ours
    monkeypatch.setattr(platform, "freedesktop_os_release", lambda: {"VERSION_ID": "14"})
    assert source_files.fingerprint(source) != ours


@pytest.mark.parametrize(
    "changed",
    [
        *("main.py", "library/tables.py", "library/tables.hpp"),
        "../../lib/librtcf_python.a",
    ],
)
def test_a_library_of_another_compiler_is_recompiled(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, changed: str
) -> None:
    found = importlib.util.find_spec("rtcf_compile")
    assert found is not None and found.origin is not None
    compiler = shutil.copytree(Path(found.origin).parent, tmp_path / "python" / "rtcf_compile")
    monkeypatch.setattr(
        importlib.util,
        "find_spec",
        lambda name: importlib.machinery.ModuleSpec(name, None, origin=str(compiler / "main.py")),
    )
    source = tmp_path / "counts.py"
    source.write_text(COUNTS)
    before = source_files.fingerprint(source)
    (compiler / changed).parent.mkdir(exist_ok=True)
    with (compiler / changed).open("a") as file:
        file.write("\n")
    assert source_files.fingerprint(source) != before


FREELY = """\
import enum

from rtcf.component import Component, Derived, Output, Parameter, State


class Größenart(enum.IntEnum):
    LÄUFT = 3


class Counts(Component):
    out: Output[float] = Output(unit="°/s")
    kp: Parameter[float] = Parameter(1.0, doc="Verstärkung")
    Δ: Derived[float]
    mode: State[Größenart]

    def prepare(self):
        self.Δ = 2.0 * self.kp

    def größe(self, ü):
        return ü + self.Δ

    def update(self):
        self.info("größe {} {}", self.größe(0.5), self.mode.name)
        self.out.write(self.größe(0.5))
        if self.iteration == 3:
            raise ValueError("zu groß: ü")
"""


@pytest.mark.parametrize("name", ["θ", "2dof", "_", "f" * 100])
def test_non_ascii_names_work_outside_ros(daemon: Daemon, client: rtcf.Client, name: str) -> None:
    source = daemon.folder / f"{name}.py"
    source.write_text(FREELY)
    done = daemon.ctl("load", str(source), "Counts")
    assert done.returncode == 0, done.stderr
    client.step(2)
    found = client.get_component("Counts")
    assert [each.doc for each in found.parameters] == ["Verstärkung"]
    assert [(each.unit, each.value) for each in found.ports] == [("°/s", "data: 2.5")]
    wait_for(lambda: "größe 2.5 LÄUFT" in daemon.log(), "the record")
    client.step(5)
    wait_for(lambda: client.get_component("Counts").fault, "the fault")
    fault = client.get_component("Counts").fault
    assert f'{name}.py:26: `raise ValueError("zu groß: ü")`: ValueError: zu groß: ü' in fault


MODES = """\
import enum

from rtcf.component import Component, Derived, Output, Parameter


class Mode(enum.IntEnum):
    IDLE = -3
    RUN = 2**40
    LÄUFT = 2**40
    HÄLT = 7


class Modes(Component):
    mode: Parameter[Mode] = Parameter(Mode.HÄLT, doc="state of the drive")
    twice: Derived[int]
    out: Output[int]

    def prepare(self):
        if self.mode is Mode.IDLE:
            raise ValueError("not idle")
        self.twice = 2 * self.mode

    def update(self):
        self.out.write(self.twice if self.mode is Mode.RUN else self.mode)
"""


def test_an_enum_parameter_is_set_by_name_as_in_cpp(daemon: Daemon, client: rtcf.Client) -> None:
    source = daemon.folder / "modes.py"
    source.write_text(MODES)
    assert daemon.ctl("load", str(source), "Modes").returncode == 0
    (mode,) = client.get_component("Modes").parameters
    assert (mode.type, mode.doc) == ("enum", "state of the drive")
    assert list(mode.choices) == ["IDLE", "RUN", "HÄLT", "LÄUFT"]
    assert mode.value.string_value == "HÄLT"

    def written() -> str:
        client.step(1)
        (out,) = client.get_component("Modes").ports
        return str(out.value)

    assert written() == "data: 7"
    assert daemon.ctl("set", "Modes", "mode:=RUN").returncode == 0
    assert written() == f"data: {2**41}"
    assert parameter_values(client, "Modes") == {"mode": "RUN"}
    assert daemon.ctl("set", "Modes", "mode:=LÄUFT").returncode == 0
    assert written() == f"data: {2**41}"
    for given, said in (
        ("WALK", "mode = WALK is none of IDLE, RUN, HÄLT, LÄUFT"),
        ("7", "mode"),
        ("IDLE", 'modes.py:20: `raise ValueError("not idle")`: ValueError: not idle'),
    ):
        refused = daemon.ctl("set", "Modes", f"mode:={given}")
        assert refused.returncode == 1 and said in refused.stderr, refused.stderr
    assert written() == f"data: {2**41}"
    done = daemon.ctl("load", str(source), "Modes", "--name", "other", "--param", "mode:=RUN")
    assert done.returncode == 0, done.stderr
    assert parameter_values(client, "other") == {"mode": "RUN"}
    graph = daemon.folder / "graph.yaml"
    assert daemon.ctl("save", str(graph)).returncode == 0
    saved = yaml.safe_load(graph.read_text())["components"]
    assert [each["parameters"]["mode"] for each in saved] == ["LÄUFT", "RUN"]
    graph.write_text(graph.read_text().replace("RUN", "HÄLT"))
    done = daemon.ctl("apply", str(graph))
    assert done.returncode == 0, done.stderr
    assert parameter_values(client, "other") == {"mode": "HÄLT"}


GROUPED = """\
import numpy as np
from rtcf.component import Component, Output, Parameter


class Grouped(Component):
    sum: Output[float]
    kp: Parameter[float] = Parameter(1.0, name="gains/p", max=100.0)
    k: Parameter[np.float64, 2] = Parameter(0.5, name="gains/k")

    def update(self):
        self.sum.write(self.kp + np.sum(self.k))
"""


def test_parameters_are_in_groups(daemon: Daemon, client: rtcf.Client) -> None:
    source = daemon.folder / "grouped.py"
    source.write_text(GROUPED)
    loaded = daemon.ctl("load", str(source), "Grouped", "--param", "gains/k_1:=2")
    assert loaded.returncode == 0, loaded.stderr
    assert daemon.ctl("set", "Grouped", "gains/p:=3").returncode == 0
    client.step(1)
    assert port_value(client, "Grouped", "sum") == 5.5
    assert "gains/p = 101" in daemon.ctl("set", "Grouped", "gains/p:=101").stderr


def test_a_wrong_source_is_rejected_in_one_line(own_cache: Path, daemon: Daemon) -> None:
    source = daemon.folder / "counts.py"
    done = daemon.ctl("load", str(source), "Counts")
    assert (done.returncode, done.stderr) == (1, f"rtcfctl: {source}: no such file\n")
    source.write_text(COUNTS.replace("STEP", "None"))
    done = daemon.ctl("load", str(source), "Counts")
    assert done.returncode == 1
    assert re.fullmatch(r"rtcfctl: .*counts\.py:9: .*: .+\n", _errors(done.stderr)), done.stderr
    done = daemon.ctl("load", "rtcf_examples", "Mimo", "--watch")
    assert done.returncode == 2 and "--watch requires a Python source" in done.stderr

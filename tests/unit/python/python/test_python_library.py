"""C++ compilation by rtcf-compile: none for a component, one for a new message."""

import os
import re
import select
import subprocess
import sys
import textwrap
from pathlib import Path
from typing import Any

import pytest
from daemon_process import BUILD_TREE
from rtcf_compile import main
from rtcf_compile.library import log_text, messages
from rtcf_compile.rewriting.logs import LogCall
from rtcf_compile.source.mistake import Mistake

COMMAND = BUILD_TREE / "bin" / "rtcf-compile"
DEADLINE_S = 600.0
VALUES = """\
import numpy as np
from rtcf.component import Component, Derived, Input, Output, Parameter, Queue, State


class Values(Component):
    u: Input[np.float64, 2, 3]
    goals: Queue[np.int64, 5] = Queue(size=4)
    x: Output[np.float64, 3, 2] = Output(finite=True)
    flags: Output[bool, 2]
    gain: Parameter[np.float64, 2] = Parameter([1.0, 2.0], min=0.0)
    twice: Derived[np.float64, 2]
    sum: State[np.int32, 7]

    def prepare(self):
        self.twice = 2.0 * self.gain

    def update(self):
        self.info("{} and {:.3f}", self.goals.size, self.goals.size)
        self.sum[0] += 1
        self.x.write(self.twice[0] * self.u.value.T)
"""
RELAY = """\
from rtcf.component import Component, Output
from std_msgs.msg import Float32


class {name}(Component):
    out: Output[Float32]

    def update(self):
        self.out.value.data = 1.0
        self.out.publish()
"""


def test_a_crash_of_the_compiler_is_one_line(tmp_path: Path) -> None:
    file = tmp_path / "crashing.py"
    file.write_text("import os, signal\n\nos.kill(os.getpid(), signal.SIGSEGV)\n")
    done = subprocess.run(
        [COMMAND, "crashing.py", "--verify"],
        cwd=tmp_path, capture_output=True, text=True, timeout=DEADLINE_S,
    )  # fmt: skip
    assert done.returncode == 1
    assert done.stderr == (
        "rtcf-compile: crashing.py: the compiler ended with SIGSEGV: "
        "write this function in another way\n"
    )


def test_a_failure_of_the_compiler_is_one_line(tmp_path: Path) -> None:
    file = tmp_path / "failing.py"
    file.write_text(f"{RELAY.format(name='Failing')}\n\nimport numba\n\nnumba.njit = None\n")
    done = subprocess.run(
        [COMMAND, "failing.py", "--verify"],
        cwd=tmp_path, capture_output=True, text=True, timeout=DEADLINE_S,
    )  # fmt: skip
    assert done.returncode == 1
    assert re.fullmatch(
        r"rtcf-compile: failing\.py: the compiler failed at \w+\.py:\d+: "
        r"TypeError: 'NoneType' object is not callable: write this function in another way\n",
        done.stderr,
    ), done.stderr


def test_numba_is_needed_only_to_compile(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    absent: Any = None
    monkeypatch.setitem(sys.modules, "numba", absent)
    file, library = tmp_path / "relay.py", tmp_path / "relay.so"
    file.write_text(RELAY.format(name="Relay"))
    assert main.main([str(file), "-o", str(library)]) == main.REFUSED
    needs = "rtcf-compile: needs numba: sudo apt install python3-numba\n"
    assert capsys.readouterr() == ("", needs)
    assert not library.exists()
    # Errors that need no compiler are reported first.
    file.write_text("x = 1\n")
    assert main.main([str(file), "-o", str(library)]) == main.REFUSED
    assert "has no component" in capsys.readouterr().err


def test_the_compiler_ends_with_its_parent(tmp_path: Path) -> None:
    # The module waits for a writer of the FIFO, and tells its process before.
    file, pid_file, fifo = (tmp_path / name for name in ("waiting.py", "pid", "fifo"))
    os.mkfifo(fifo)
    os.mkfifo(pid_file)
    file.write_text(
        "import os\n\n"
        f"open({str(pid_file)!r}, 'w').write(str(os.getpid()))\nopen({str(fifo)!r}).read()\n"
    )
    command = subprocess.Popen([COMMAND, file, "--verify"])
    child = os.pidfd_open(int(pid_file.read_text()))
    command.kill()
    command.wait()
    assert select.select([child], [], [], DEADLINE_S)[0]


class Cache:
    """A user's cache, and a compiler that records its calls."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self._calls = folder / "calls"
        self._compiler = folder / "c++"
        self._compiler.write_text(f'#!/bin/sh\necho "$@" >>{self._calls}\nexec /usr/bin/g++ "$@"\n')
        self._compiler.chmod(0o755)

    def start(self, source: str, name: str = "source") -> "subprocess.Popen[str]":
        """Start to compile a source."""
        file = self.folder / f"{name}.py"
        file.write_text(source)
        environment = {
            "PATH": "/usr/bin:/bin",
            "HOME": str(self.folder),
            "XDG_CACHE_HOME": str(self.folder / "cache"),
            "CXX": str(self._compiler),
        }
        return subprocess.Popen(
            [str(COMMAND), str(file), "-o", str(self.folder / name / f"{name}.so")],
            env=environment,
            stderr=subprocess.PIPE,
            text=True,
        )

    def compile(self, source: str, name: str = "source") -> str:
        """Compile a source; return the message."""
        process = self.start(source, name)
        said = process.communicate(timeout=DEADLINE_S)[1]
        assert process.returncode == 0, said
        return said

    def compiled(self) -> list[str]:
        """Return the C++ sources compiled since the last call."""
        calls = self._calls.read_text()
        self._calls.unlink()
        return [Path(each).name for each in re.findall(r"\S+\.cpp", calls)]

    def kept(self) -> list[Path]:
        """Return the messages in the cache."""
        return sorted((self.folder / "cache/rtcf-components/.messages").iterdir())


@pytest.fixture
def cache(tmp_path: Path) -> Cache:
    return Cache(tmp_path)


def test_no_cpp_is_compiled_for_a_component(cache: Cache) -> None:
    assert cache.compile(VALUES) == ""
    assert cache.compiled() == []
    needed = subprocess.run(
        ["objdump", "-p", str(cache.folder / "source" / "source.so")],
        capture_output=True, text=True, check=True,
    ).stdout  # fmt: skip
    libraries = set(re.findall(r"NEEDED\s+([a-z_]+)", needed))
    assert libraries <= {
        *("libc", "libfmt", "libgcc_s", "libm", "libroscpp_serialization", "librostime"),
        "libstdc",
    }


def test_a_message_is_compiled_once_and_cached(cache: Cache) -> None:
    said = cache.compile(RELAY.format(name="First"))
    assert said == "rtcf-compile: compiling std_msgs/Float32 once\n"
    assert len(cache.compiled()) == 1
    (kept,) = cache.kept()
    assert kept.name.startswith("std_msgs-Float32-")
    assert cache.compile(RELAY.format(name="Second"), "second") == ""
    assert cache.compiled() == []
    assert cache.kept() == [kept]


def test_files_that_others_can_write_are_recompiled(cache: Cache) -> None:
    cache.compile(RELAY.format(name="First"))
    (kept,) = cache.kept()
    kept.write_bytes(b"no object file")
    kept.chmod(0o666)
    assert "once" in cache.compile(RELAY.format(name="First"))
    assert kept.read_bytes().startswith(b"\x7fELF") and kept.stat().st_mode & 0o777 == 0o644


def test_two_compilers_can_compile_a_message_at_once(cache: Cache) -> None:
    both = [cache.start(RELAY.format(name=each), each) for each in ("One", "Other")]
    for each in both:
        said = each.communicate(timeout=DEADLINE_S)[1]
        assert each.returncode == 0, said
    assert len(cache.kept()) == 1


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ("Float32._type = 'std_msgs/Absent'", r"std_msgs/Absent: has no C\+\+ header: sudo apt "),
        (
            "Float32._md5sum = 32 * '0'",
            r"std_msgs/Float32: the C\+\+ header and the Python class have different definitions",
        ),
    ],
)
def test_a_message_without_its_header_is_rejected(cache: Cache, change: str, said: str) -> None:
    source = RELAY.format(name="Odd").replace("\n\n\nclass", f"\n\n{change}\n\n\nclass")
    process = cache.start(source)
    lines = process.communicate(timeout=DEADLINE_S)[1].splitlines()
    assert process.returncode == 1
    assert re.match(rf"rtcf-compile: {said}", lines[-1]), lines
    assert cache.kept() == []


def test_a_missing_runtime_is_named(
    cache: Cache, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    from rtcf_compile.library import toolchain

    monkeypatch.setenv("RTCF_PYTHON_RUNTIME", str(tmp_path / "absent.a"))
    with pytest.raises(Mistake, match=r"absent\.a: does not exist: sudo apt install librtcf-dev"):
        toolchain.runtime()


def test_code_runs_on_any_processor_with_any_import_order() -> None:
    program = textwrap.dedent("""
        import rtcf_compile.library.build
        import numba

        print(numba.config.CPU_NAME, repr(numba.config.CPU_FEATURES))
    """)
    done = subprocess.run(
        ["/usr/bin/python3", "-c", program],
        env={"PATH": "/usr/bin:/bin", "PYTHONPATH": str(BUILD_TREE / "python")},
        capture_output=True, text=True, check=True,
    )  # fmt: skip
    assert done.stdout == "generic ''\n"


def test_the_files_that_the_sources_read_are_listed(tmp_path: Path) -> None:
    source, table, module = (
        tmp_path / "source.py", tmp_path / "a table.txt", tmp_path / "more" / "gains.py"
    )  # fmt: skip
    module.parent.mkdir()
    (module.parent / "__init__.py").touch()
    module.write_text("GAIN = 2.0\n")
    table.write_text("1 2\n")
    text = (
        "import json\n\nimport numpy as np\nfrom more.gains import GAIN\n"
        f"TABLE = np.loadtxt({str(table)!r})\nopen({str(tmp_path / 'written')!r}, 'w').close()\n"
    )
    rule = tmp_path / "source.d"
    for each in ("x = GAIN\n", "x = absent\n"):  # also if the module fails
        rule.unlink(missing_ok=True)
        source.write_text(text + each)
        words = [*map(str, (COMMAND, source, "-o", tmp_path / "source.so", "--depfile", rule))]
        subprocess.run(words, stderr=subprocess.PIPE, timeout=DEADLINE_S)
        listed = rule.read_text().replace(" \\\n", "").split("  ")
        files = [str(table).replace(" ", "\\ "), str(module.parent / "__init__.py"), module, source]
        assert listed == [f"{tmp_path}/source.so:", *map(str, files[:-1]), f"{source}\n"]


def test_a_messages_name_becomes_a_symbol() -> None:
    message: Any = type("Message", (), {"name": "sensor_msgs/JointState"})
    assert messages.symbol(message) == "rtcf_message_sensor_msgs__JointState"


def _call(text: str, *types: str) -> LogCall:
    return LogCall("info", text, "x.py", 3, "update", len(types), list(types))


@pytest.mark.parametrize(
    ("text", "types", "stored"),
    [
        ("plain {{}}", (), []),
        ("{} {:d} {:.3f}", ("bool", "int64", "float64"), ["bool", "int64", "float64"]),
        ("{1} {0:>8.2e}", ("float64", "int64"), ["float64", "int64"]),
        ("{:.1f} {:g}", ("int64", "bool"), ["float64", "float64"]),
    ],
)
def test_a_log_text_determines_how_arguments_are_stored(
    text: str, types: tuple[str, ...], stored: list[str]
) -> None:
    assert log_text.checked(_call(text, *types)) == (text, stored)


@pytest.mark.parametrize(
    ("text", "types", "said"),
    [
        ("{} {}", ("int64",), "has more placeholders than arguments"),
        ("{}", ("int64", "float64"), "has fewer placeholders than arguments"),
        ("{", (), r"Single '\{' encountered"),
        ("{:d}", ("float64",), "cannot show a float64"),
        ("{:,}", ("int64",), r"\{:,\} is not supported"),
        ("{!r}", ("int64",), "!r is not supported"),
        ("{speed}", ("float64",), r"\{speed\} is named"),
        ("{} {0}", ("float64",), "in one text"),
        ("{0} {0:.1f}", ("int64",), "as an int and as a float"),
    ],
)
def test_an_impossible_log_text_is_rejected(text: str, types: tuple[str, ...], said: str) -> None:
    with pytest.raises(Mistake, match=said) as raised:
        log_text.checked(_call(text, *types))
    assert str(raised.value).startswith("x.py:3: ")

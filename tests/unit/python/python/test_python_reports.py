"""One run of rtcf-compile reports all errors that it can find."""

import re
from pathlib import Path

import pytest
from rtcf_compile.main import main

HEAD = """\
import numpy as np
from rtcf.component import Component, Input, Output, Parameter, State
"""
SYNTAX = """

class First(Component):
    u: Input[float]
    y: Output[float]
    n: State[int]

    def start(self):
        self.m = 3

    def update(self):
        print(self.u.value)
        if open("x"):
            try:
                b"text"
            except ValueError:
                self.n.append(1)
        self.y.write(self.half(absent + absent))
        self.n = later
        later = 2
        absent.x = 1

    def half(self, x):
        eval("x")
        self.total += 1
        self.total += 2
        return 0.5 * x

    def never_called(self):
        print(self.n)
"""
TYPES = """

class Second(Component):
    u: Input[float]
    z: State[np.float64, 2]
    n: State[int]

    def start(self):
        self.n = 0.5
        self.z[:] = "a"

    def both(self):
        self.n = 1.5
        return self.z @ "b"

    def update(self):
        k = self.both()
        self.n = k
        self.n = self.z
        self.info("{}", self.z)
        self.info("{:d}", self.u.value)

    def safe(self):
        self.both()
        for _ in self.u.value:
            pass
"""
DECLARED = """

class Third(Component):
    u: Input[float | None]
    p: Parameter[float]
    v: State
    dt: State[float]

    def update(self):
        print(self.u)
"""


def reported(
    folder: Path, capsys: pytest.CaptureFixture[str], *sources: str
) -> list[tuple[str, str]]:
    """Compile sources that must fail; return the lines of code and the messages, in their order."""
    files = [folder / f"faulty_{number}.py" for number in range(len(sources))]
    for file, text in zip(files, sources, strict=True):
        file.write_text(text)
    assert main([*map(str, files), "-o", str(folder / "faulty.so")]) == 1
    assert not (folder / "faulty.so").exists()
    places, found = [], []
    for line in capsys.readouterr().err.splitlines():
        parts = re.fullmatch(r"rtcf-compile: \S*faulty_(\d)\.py:(\d+): (.*)", line)
        if parts is None:
            found.append(("", line))
            continue
        places.append((int(parts[1]), int(parts[2])))
        code = sources[int(parts[1])].splitlines()[int(parts[2]) - 1]
        found.append((code.strip(), parts[3]))
    assert places == sorted(places)
    return found


def _checked(found: list[tuple[str, str]], expected: list[tuple[str, str]]) -> None:
    assert [code for code, _ in found] == [code for code, _ in expected]
    for (_, message), (_, words) in zip(found, expected, strict=True):
        assert words in message


def test_all_errors_of_syntax_and_members_are_reported(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    found = reported(tmp_path, capsys, HEAD + SYNTAX)
    _checked(
        found,
        [
            ("self.m = 3", "is not declared"),
            ("print(self.u.value)", "printing calls the system"),
            ('if open("x"):', "opening a file"),
            ("try:", "exceptions cannot be caught"),
            ('b"text"', "bytes are not compiled"),
            ("self.n.append(1)", "cannot grow"),
            ("self.y.write(self.half(absent + absent))", "absent is not defined"),
            ('eval("x")', "cannot run Python code"),
        ],
    )


def test_all_errors_of_members_are_reported_once(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    found = reported(tmp_path, capsys, HEAD + SYNTAX.replace('eval("x")', "pass"))
    assert [code for code, _ in found if "total" in code] == ["self.total += 1"]


def test_variables_without_a_value_are_reported_once(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    text = SYNTAX[: SYNTAX.index("        print(self.u.value)")]
    text += "        self.n = one\n        self.n = one + two\n        one = two = 1\n"
    found = reported(tmp_path, capsys, HEAD + text)
    _checked(
        found,
        [
            ("self.m = 3", "is not declared"),
            ("self.n = one", "one may have no value here"),
            ("self.n = one + two", "two may have no value here"),
        ],
    )


def test_all_errors_of_types_are_reported(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    found = reported(tmp_path, capsys, HEAD + TYPES)
    _checked(
        found,
        [
            ("self.n = 0.5", "a whole number is set to a float"),
            ('self.z[:] = "a"', "is set to a text"),
            ("self.n = 1.5", "a whole number is set to a float"),
            ('return self.z @ "b"', "a text"),
            ("self.n = self.z", "a whole number is set to a vector"),
            ('self.info("{}", self.z)', "a log call stores numbers"),
            ("for _ in self.u.value:", "a loop over a float"),
        ],
    )


def test_all_formats_of_log_calls_are_checked(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    calls = 'self.info("{:d}", self.u.value)\n        self.info("{} {}", self.n)\n'
    text = TYPES[: TYPES.index("    def start")] + f"    def update(self):\n        {calls}"
    found = reported(tmp_path, capsys, HEAD + text)
    _checked(
        found,
        [
            ('self.info("{:d}", self.u.value)', "cannot show a float64"),
            ('self.info("{} {}", self.n)', "more placeholders than arguments"),
        ],
    )


def test_errors_of_all_components_and_files_are_sorted(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    found = reported(tmp_path, capsys, HEAD + DECLARED + TYPES, "x = = 1\n", HEAD + DECLARED)
    declared = [
        ("u: Input[float | None]", "only a State may be None"),
        ("p: Parameter[float]", "has no default"),
        ("v: State", "has no type"),
        ("dt: State[float]", "is a reserved name"),
        ("print(self.u)", "printing calls the system"),
    ]
    assert [code for code, _ in found[:5]] == [code for code, _ in declared]
    assert [code for code, _ in found[5:12]] == [
        *("self.n = 0.5", 'self.z[:] = "a"', "self.n = 1.5", 'return self.z @ "b"'),
        *("self.n = self.z", 'self.info("{}", self.z)', "for _ in self.u.value:"),
    ]
    assert found[12][0] == "x = = 1"
    assert "Third is defined twice" in found[13][1]
    assert len(found) == 14


def test_at_most_twenty_errors_are_reported(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    lines = "".join(f"        print({number})\n" for number in range(25))
    text = f"{HEAD}\n\nclass Many(Component):\n    n: State[int]\n\n    def update(self):\n{lines}"
    found = reported(tmp_path, capsys, text)
    assert [code for code, _ in found[:20]] == [f"print({number})" for number in range(20)]
    assert found[20:] == [("", "rtcf-compile: and 5 more")]


def test_an_error_in_a_helper_is_at_its_place(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "faulty_9.py").write_text("def far(x):\n    y = x\n    return y.real.foo\n")
    text = f"{HEAD}from faulty_9 import far\n\n\nclass Calls(Component):\n    n: State[int]\n\n"
    text += "    def update(self):\n        self.n = far(self.n)\n        self.n = 0.5\n"
    (tmp_path / "faulty.py").write_text(text)
    assert main([str(tmp_path / "faulty.py"), "-o", str(tmp_path / "faulty.so")]) == 1
    first, second = capsys.readouterr().err.splitlines()
    assert re.search(r"faulty\.py:11: `self\.n = 0\.5`: ", first)
    assert re.search(r"faulty_9\.py:3: `return y\.real\.foo`: ", second)

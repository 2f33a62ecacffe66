"""Files of sources: saved while they are compiled, in another encoding, or ending Python."""

import os
import time
from pathlib import Path
from typing import Any

import pytest
from rtcf_compile.comparison import verify
from rtcf_compile.comparison.inside import Inside
from rtcf_compile.library import toolchain
from rtcf_compile.machine_code import object_file
from rtcf_compile.source import dependencies, modules, processor_time
from rtcf_compile.source.mistake import Mistake

SOURCE = """\
from rtcf.component import Component, Output
from {helper} import offset


class Sum(Component):
    y: Output[float]

    def first(self):
        return 1.0

    def second(self):
        return 100.0

    def update(self):
        self.y.write(self.first() + offset())
"""
HELPER = "def offset():\n    return 0.5\n\n\ndef other():\n    return 7.5\n"


def test_a_file_that_is_saved_after_it_ran_is_compiled_as_it_ran(tmp_path: Path) -> None:
    file, helper = tmp_path / "sums.py", tmp_path / "saved_helper.py"
    text = SOURCE.format(helper=helper.stem)
    file.write_text(text)
    helper.write_text(HELPER)
    (cls,) = modules.components(modules.load(file))
    # The same meaning, in another order.
    first, second = text[text.index("    def f") :].split("\n\n")[:2]
    file.write_text(text.replace(first, "X").replace(second, first).replace("X", second))
    helper.write_text("\n\n".join(reversed(HELPER.split("\n\n\n"))))
    compiled = object_file.compile_component(cls)
    component: Any = cls()
    assert verify.compare(cls, compiled, 3).differences == []
    record = component._record
    assert Inside(compiled).call("update", record) is None
    assert record["y"] == 1.5
    # The next load reads it again.
    file.write_text(text.replace("1.0", "2.0"))
    (cls,) = modules.components(modules.load(file))
    record = cls()._record
    assert Inside(object_file.compile_component(cls)).call("update", record) is None
    assert record["y"] == 2.5


def test_form_feeds_do_not_end_lines(tmp_path: Path) -> None:
    file, helper = tmp_path / "feeds.py", tmp_path / "feeds_helper.py"
    helper.write_text(HELPER)
    text = SOURCE.format(helper=helper.stem)
    file.write_text(text.replace("    def f", "    # \x0c \x1c \u2028\n    def f").rstrip("\n"))
    (cls,) = modules.components(modules.load(file))
    record = cls()._record
    assert Inside(object_file.compile_component(cls)).call("update", record) is None
    assert record["y"] == 1.5


@pytest.mark.parametrize("is_helper", [False, True])
def test_a_byte_that_is_not_utf_8_is_an_error_with_its_line(
    tmp_path: Path, is_helper: bool
) -> None:
    file, helper = tmp_path / "sums.py", tmp_path / f"latin_{is_helper}.py"
    file.write_text(SOURCE.format(helper=helper.stem))
    helper.write_text(HELPER)
    wrong = helper if is_helper else file
    lines = wrong.read_text().count("\n")
    wrong.write_bytes(wrong.read_bytes() + b"# gr\xf6\xdfer\n")
    with pytest.raises(Mistake) as raised:
        modules.load(file)
    what = "byte 0xf6 is not UTF-8: save the file in this encoding"
    assert str(raised.value) == f"{wrong}:{lines + 1}: {what}"
    wrong.write_bytes(b"# -*- coding: latin-1 -*-\n" + wrong.read_bytes())
    (cls,) = modules.components(modules.load(file))
    assert cls.__name__ == "Sum"


@pytest.mark.parametrize("text", ["sys.exit()", "sys.exit(3)", "exit(3)", "raise SystemExit"])
def test_a_module_that_ends_python_is_rejected(tmp_path: Path, text: str) -> None:
    file = tmp_path / "ending.py"
    file.write_text(f"import sys\n\n{text}\n")
    with pytest.raises(Mistake) as raised:
        modules.load(file)
    remedy = 'remove it, or write it below if __name__ == "__main__":'
    assert str(raised.value) == f"{file}:3: `{text}`: the module ends Python: {remedy}"


def test_a_module_that_does_not_end_is_rejected(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    file = tmp_path / "endless.py"
    file.write_text("x = 0\n\nwhile True:\n    x += 1\n")
    monkeypatch.setattr(processor_time, "MODULE_S", 0.3)
    with pytest.raises(Mistake) as raised:
        modules.load(file)
    what = "the module takes more than 0 s of processor time: end its loops, or compute less here"
    assert str(raised.value) == f"{file}:3: `while True:`: {what}"


def test_make_compiles_again_what_was_saved_during_a_compilation(tmp_path: Path) -> None:
    file, library = tmp_path / "timed.py", tmp_path / "timed.so"
    file.write_text("x = 1\n")
    modules.load(file)
    library.write_text("")
    begin_ns = time.time_ns() + 10**9
    for saved_ns, is_old in ((begin_ns - 10**8, False), (begin_ns - 10**6, True)):
        os.utime(file, ns=(saved_ns, saved_ns))
        os.utime(library, ns=(begin_ns, begin_ns))
        dependencies.set_time(library, begin_ns)
        assert (library.stat().st_mtime_ns < saved_ns) == is_old


@pytest.mark.parametrize(
    ("said", "remedy"),
    [
        ("collect2: error: ld returned 1 exit status\n", "free space on the disk, or memory"),
        ("/usr/bin/ld: cannot find -lm: No such file or directory\n", "install librtcf-dev"),
        ("ld: undefined reference to `f'\ncollect2: error: ld returned 1\n", "bug of rtcf-compile"),
    ],
)
def test_an_error_of_the_linker_has_a_remedy(said: str, remedy: str) -> None:
    assert remedy in str(toolchain.mistake("a.py", said))

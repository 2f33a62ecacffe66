"""Each mistake of the corpus is one line of error: file, line, expression, and advice."""

import re
import textwrap
from pathlib import Path

import mistakes
import pytest
from rtcf_compile.main import main

# Words of numba, LLVM, NumPy's internals and the compiler's own internals.
_INTERNAL = re.compile(
    r"numba|llvm|reflected|UniTuple|Tuple\(|array\(\w+, \d|OptionalType|gufunc|core dimension|\$|"
    r"unknown location|Literal|[Dd]ispatcher|rtcf_|constant_|overload|lowering|[Rr]esolv|"
    r"signature|typing|nopython|unicode_type|getitem|getiter|IntEnum<|IntEnum class|"
    r"<(?:function|class|built-in|module|numba)|0x[0-9a-f]{6}|NRT_|Invalid use|"
    r"Internal error|implementation|'object'|Traceback|<string>"
)
# Advice starts with one of these words.
_VERBS = (
    *(
        "add",
        "bound",
        "call",
        "choose",
        "close",
        "compare",
        "compute",
        "convert",
        "copy",
        "correct",
        "declare",
    ),
    *("define", "derive", "draw", "exchange", "give", "import", "keep", "leave", "log", "look"),
    *("make", "match", "mend", "move", "name", "pass", "read", "remove", "rename", "return"),
    *("round", "set", "take", "test", "use", "write"),
)


def source(kind: str, text: str) -> str:
    """Return a module with a mistake at its head, in the class, or in update."""
    parts = {"HEAD": "", "CLASS": "", "UPDATE": "", kind: text}
    if "\n---\n" in text:
        parts["HEAD"], parts[kind] = text.split("\n---\n")
    head = f"{parts['HEAD']}\n\n\n" if parts["HEAD"] else ""
    members = textwrap.indent(parts["CLASS"], "    ")
    update = textwrap.indent(parts["UPDATE"], "        ")
    return (
        f"{mistakes.MODULE}{head}{mistakes.MEMBERS}{members}\n"
        f"    def update(self):\n        self.n += 1\n{update}\n"
    )


def line_of(text: str, whole: str) -> int:
    """Return the marked line, or the first line of the mistake."""
    lines = whole.splitlines()
    marked = [number for number, line in enumerate(lines, 1) if line.endswith("# here")]
    if marked:
        assert len(marked) == 1
        return marked[0]
    first = text.split("\n---\n")[-1].splitlines()[0]
    return next(number for number, line in enumerate(lines, 1) if line.strip() == first)


def cases() -> list[tuple[str, str]]:
    """Return each mistake by its place and its name."""
    return [
        (kind, name) for kind in ("UPDATE", "CLASS", "HEAD") for name in getattr(mistakes, kind)
    ]


def test_the_corpus_is_large() -> None:
    assert len(cases()) >= 200


@pytest.mark.parametrize(("kind", "name"), cases())
def test_a_mistake_is_one_line_with_place_expression_and_advice(
    kind: str, name: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    text, words = getattr(mistakes, kind)[name]
    whole = source(kind, text)
    file = tmp_path / "faulty.py"
    file.write_text(whole)
    assert main([str(file), "-o", str(tmp_path / "faulty.so")]) == 1
    said = capsys.readouterr().err
    found = re.fullmatch(r"rtcf-compile: \S*faulty\.py:(\d+): `(.*?)`: (.*)\n", said)
    assert found, said
    line, quoted, rest = int(found[1]), found[2], found[3]
    assert line == line_of(text, whole), said
    written = whole.splitlines()[line - 1]
    assert quoted and quoted in written, said
    assert words in said, said
    unquoted = said.replace(quoted, "").replace(str(tmp_path), "")
    assert not _INTERNAL.search(unquoted), said
    ways_out = [each.split(" ")[0] for each in rest.split(": ")[1:]]
    assert any(each in _VERBS for each in ways_out), said

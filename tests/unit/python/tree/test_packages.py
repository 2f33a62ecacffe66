"""Dependencies of the packages: exactly the needed programs, and no compiler without need."""

import re
import subprocess
from pathlib import Path

import pytest
from daemon_process import BUILD_TREE
from pages import TREE

# With the compilers that each package calls.
COMPILERS = {
    "librtcf-dev": {"cmake", "g++"},  # to build components
    "rtcf-python": {"g++"},  # called by rtcf-compile
}
_COMPILER = re.compile(
    r"cmake|make|ninja-build|g\+\+.*|gcc.*|cpp.*|build-essential|lld.*|rustc|ccache"
    r"|(lib)?(clang|llvm)[-0-9.a-z]*|protobuf-compiler.*"
)


def _names(text: str) -> list[str]:
    """Return the packages of a field, alternatives one by one."""
    return [
        re.split(r"[\s(<:\[]", each.strip())[0] for each in re.split(r"[,|]", text) if each.strip()
    ]


def _paragraphs() -> list[dict[str, str]]:
    text = (TREE / "debian" / "control").read_text()
    return [
        dict(re.findall(r"^(\S+):((?:.*\n)(?: .*\n)*)", f"{paragraph}\n", re.MULTILINE))
        for paragraph in text.split("\n\n")
    ]


SOURCE, *BINARIES = _paragraphs()


@pytest.mark.parametrize("package", BINARIES, ids=[each["Package"].strip() for each in BINARIES])
def test_a_package_depends_on_no_compiler_that_it_does_not_run(package: dict[str, str]) -> None:
    name = package["Package"].strip()
    pulled = [*_names(package["Depends"]), *_names(package.get("Recommends", ""))]
    assert pulled
    compilers = {each for each in pulled if _COMPILER.fullmatch(each)}
    assert compilers == COMPILERS.get(name, set())


def test_the_checker_needs_no_more_than_an_executor_and_a_symbolizer() -> None:
    (checker,) = (each for each in BINARIES if each["Package"].strip() == "rtcf-check")
    assert _names(checker["Depends"]) == [
        "binutils", "rtcfctl", "rtcfd", "${misc", "${shlibs",
    ]  # fmt: skip
    assert "Recommends" not in checker
    # addr2line is a part of binutils.
    assert '"addr2line"' in (TREE / "client" / "rtcf" / "checking.py").read_text()


@pytest.mark.parametrize("paragraph", [SOURCE, *BINARIES])
@pytest.mark.parametrize("field", ["Build-Depends", "Depends", "Recommends", "Suggests"])
def test_no_dependency_is_listed_twice(paragraph: dict[str, str], field: str) -> None:
    names = [each for each in _names(paragraph.get(field, "")) if not each.startswith("$")]
    assert len(names) == len(set(names)), sorted(names)


@pytest.mark.parametrize(
    ("language", "needed"),
    [
        ((), ["librtcf-dev", "libgtest-dev"]),
        (("--python",), ["rtcf-python", "python3-pytest"]),
    ],
)
def test_a_new_package_builds_and_tests_with_the_dependencies(
    tmp_path: Path, language: tuple[str, ...], needed: list[str]
) -> None:
    done = subprocess.run(
        [BUILD_TREE / "bin" / "rtcfctl", "new", "my_arm", "Gain", *language],
        cwd=tmp_path, capture_output=True, text=True, check=True,
    )  # fmt: skip
    assert f"(apt install {' '.join(needed)})" in done.stdout
    first, *others = needed
    (package,) = (each for each in BINARIES if each["Package"].strip() == first)
    assert set(others) <= {*_names(package["Depends"]), *_names(package["Recommends"])}

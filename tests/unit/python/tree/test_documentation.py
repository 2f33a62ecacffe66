"""Pages, packages, commands and options named in README, docs and manual pages exist."""

import argparse
import re
import shlex
from collections.abc import Iterator
from pathlib import Path

import pytest
from documentation_commands import ELSEWHERE, PAGES, page_name
from pages import TREE, shell_lines
from rtcfctl.main import parser

NAMES = [page_name(page) for page in PAGES]
CONTROL = (TREE / "debian" / "control").read_text()
OURS = set(re.findall(r"^Package: (\S+)", CONTROL, re.MULTILINE))


@pytest.mark.parametrize("page", PAGES, ids=NAMES)
def test_links_lead_to_existing_pages(page: Path) -> None:
    for link in re.findall(r"\]\(([^)#]+)\)", page.read_text()):
        if not link.startswith("http"):
            assert (page.parent / link).exists(), link
    for name in re.findall(r"/usr/share/doc/rtcf/(\S+?\.md)", page.read_text()):
        assert (TREE / name).exists(), name


def test_links_of_installed_pages_lead_to_installed_files() -> None:
    installed: dict[Path, Path] = {}  # installed path -> source file
    for line in (TREE / "debian" / "rtcf-doc.install").read_text().splitlines():
        pattern, folder = line.split()
        installed |= {Path("/", folder, file.name): file for file in TREE.glob(pattern)}
    dead = [
        f"{file.name}: {link}"
        for place, file in installed.items()
        if file.suffix == ".md"
        for link in re.findall(r"""(?:\]\(|src="|srcset=")([^)#"]+)[)"#]""", file.read_text())
        if not link.startswith("http") and (place.parent / link).resolve() not in installed
    ]
    assert dead == []


def options_of(found: argparse.ArgumentParser) -> Iterator[str]:
    """Yield the long options of a parser and of the verbs below it."""
    for action in found._actions:
        if isinstance(action, argparse._SubParsersAction):
            for below in action.choices.values():
                yield from options_of(below)
        else:
            yield from (each for each in action.option_strings if each.startswith("--"))


def test_each_option_of_rtcfctl_is_in_its_manual_page() -> None:
    # The scope's options are in the page of its service.
    pages = [(TREE / "docs" / "man" / name).read_text() for name in ("rtcfctl.1", "rtcf-scope.8")]
    named = set(re.findall(r"--[a-z-]*[a-z]", "".join(pages).replace("\\-", "-")))
    assert sorted({*options_of(parser())} - named - {"--help"}) == []


@pytest.mark.parametrize(
    "setting", ["on_boot", "on_crash", "realtime", "overrun", "sim_time", "ros_peers"]
)
def test_the_values_of_an_option_are_in_the_manual_page(setting: str) -> None:
    (runner,) = (a for a in parser()._actions if isinstance(a, argparse._SubParsersAction))
    (noun,) = (
        a for a in runner.choices["runner"]._actions if isinstance(a, argparse._SubParsersAction)
    )
    (found,) = (a for a in noun.choices["set"]._actions if a.dest == setting)
    manual = (TREE / "docs" / "man" / "rtcfctl.1").read_text().replace("\\-", "-")
    head = re.search(rf"^\.BR? {found.option_strings[0]} \"? *([a-z_|]+)", manual, re.MULTILINE)
    assert head, found.option_strings
    assert set(head[1].split("|")) == set(found.choices or ())


def test_each_page_is_linked_from_the_index() -> None:
    index = (TREE / "docs" / "index.md").read_text()
    pages = [name for name in NAMES if name not in ("README.md", "index.md")]
    assert [name for name in pages if f"]({name})" not in index] == []


def test_the_index_is_linked_from_the_readme() -> None:
    assert "](docs/index.md)" in (TREE / "README.md").read_text()


def test_manual_pages_use_installed_paths_of_the_docs() -> None:
    installed = (TREE / "debian" / "rtcf-doc.install").read_text()
    assert "README.md usr/share/doc/rtcf\n" in installed
    assert "docs/*.md usr/share/doc/rtcf/docs\n" in installed
    for manual in (TREE / "docs" / "man").iterdir():
        text = manual.read_text().replace("\\-", "-")
        for name in re.findall(r"/usr/share/doc/(\S+\.md)", text):
            assert name.startswith("rtcf/"), f"{manual.name}: {name}"
            assert (TREE / name.removeprefix("rtcf/")).exists(), f"{manual.name}: {name}"


@pytest.mark.parametrize("page", PAGES, ids=NAMES)
def test_commands_in_pages_are_commands_of_rtcfctl(page: Path) -> None:
    for line in shell_lines(page.read_text()):
        words = shlex.split(line, comments=True)
        if words[:1] == ["sudo"]:
            words = words[1:]
        if words[:1] != ["rtcfctl"]:
            continue
        # Placeholders in texts are capitals or "…".
        given = ["1" if re.fullmatch(r"N|S|…", word) else word for word in words[1:]]
        cut = next((at for at, word in enumerate(given) if word in ("|", "&&", ";", ">")), None)
        try:
            parser().parse_args(given[:cut])
        except SystemExit:
            pytest.fail(f"{page.name}: {line}")


@pytest.mark.parametrize("page", PAGES, ids=NAMES)
def test_our_packages_in_pages_exist(page: Path) -> None:
    for line in shell_lines(page.read_text()):
        if " apt install " not in line:
            continue
        for word in re.findall(r"(?:build/deb/)?((?:lib|ros-|python3-)?rtcf[a-z-]*)", line):
            assert word.rstrip("_") in OURS, f"{page.name}: {word}"


@pytest.mark.parametrize(("page", "begin"), [(p, b) for p in ELSEWHERE for b in ELSEWHERE[p]])
def test_commands_tested_elsewhere_are_in_their_page(page: str, begin: str) -> None:
    (file,) = (each for each in PAGES if page_name(each) == page)
    assert any(line.startswith(begin) for line in shell_lines(file.read_text()))
    for test in re.findall(r"tests/\S+\.py", ELSEWHERE[page][begin]):
        assert (TREE / test).exists(), test

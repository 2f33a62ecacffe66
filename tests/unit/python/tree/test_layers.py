"""Imports and includes between layers point down, and `make lint` reports exceptions."""

import subprocess
from pathlib import Path

import pytest
from pages import TREE


def check(*arguments: Path) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [TREE / "tools" / "check-arrows", *arguments], capture_output=True, text=True
    )


@pytest.fixture
def stack(tmp_path: Path) -> Path:
    """A package of two correct layers."""
    (tmp_path / "layers").write_text("stack.upper\nstack.lower\nstack\n")
    for room in ("upper", "lower"):
        (tmp_path / "src" / "stack" / room).mkdir(parents=True)
        (tmp_path / "src" / "stack" / room / "__init__.py").touch()
    (tmp_path / "src" / "stack" / "__init__.py").touch()
    (tmp_path / "src" / "stack" / "upper" / "user.py").write_text("from stack.lower import item\n")
    (tmp_path / "src" / "stack" / "lower" / "item.py").touch()
    return tmp_path


def test_the_layers_of_this_tree_are_correct() -> None:
    found = check()
    assert (found.returncode, found.stderr) == (0, "")


def test_lint_checks_them() -> None:
    assert "tools/check-arrows" in (TREE / "tools" / "lint").read_text()


def test_an_import_of_a_lower_layer_is_accepted(stack: Path) -> None:
    assert check(stack / "layers", stack).returncode == 0


@pytest.mark.parametrize(
    "text",
    [
        "from stack.upper.user import user",
        "def late():\n    import stack.upper.user",
        "import typing\nif typing.TYPE_CHECKING:\n    from stack.upper import user",
    ],
)
def test_an_import_of_a_higher_layer_is_rejected(stack: Path, text: str) -> None:
    (stack / "src" / "stack" / "upper" / "user.py").touch()
    (stack / "src" / "stack" / "lower" / "item.py").write_text(text)
    found = check(stack / "layers", stack)
    assert found.returncode == 1
    assert "stack.lower must not import stack.upper" in found.stderr


def test_a_circle_within_a_package_is_rejected(stack: Path) -> None:
    lower = stack / "src" / "stack" / "lower"
    (lower / "item.py").write_text("from stack.lower.shelf import Shelf")
    (lower / "shelf.py").write_text(
        "from typing import TYPE_CHECKING\nif TYPE_CHECKING:\n    import stack.lower.item"
    )
    found = check(stack / "layers", stack)
    assert found.returncode == 1
    assert "in a circle" in found.stderr


def test_a_module_without_a_layer_is_rejected(stack: Path) -> None:
    (stack / "layers").write_text("stack.upper\nstack.lower\n")
    assert "has no package for it" in check(stack / "layers", stack).stderr


@pytest.fixture
def hall(tmp_path: Path) -> Path:
    """A C++ package of two correct layers."""
    (tmp_path / "layers").write_text("hall.main\nhall.gallery\nhall.vault\n")
    for room in ("gallery", "vault"):
        (tmp_path / "src" / "hall" / room).mkdir(parents=True)
    (tmp_path / "src" / "hall" / "CMakeLists.txt").touch()
    for file, text in (
        ("main.cpp", '#include "gallery/view.hpp"\n'),
        ("gallery/view.hpp", '#include <vector>\n#include "vault/coin.hpp"\n'),
        ("gallery/view.cpp", '#include "gallery/view.hpp"\n'),
        ("vault/coin.hpp", '#include "another/library.hpp"\n'),
    ):
        (tmp_path / "src" / "hall" / file).write_text(text)
    return tmp_path


def test_includes_of_a_lower_layer_are_accepted(hall: Path) -> None:
    found = check(hall / "layers", hall)
    assert (found.returncode, found.stderr) == (0, "")


@pytest.mark.parametrize("file", ["coin.hpp", "coin.cpp"])
@pytest.mark.parametrize(
    "text", ['#include "gallery/view.hpp"', '# include "hall/gallery/view.hpp"']
)
def test_an_include_of_a_higher_layer_is_rejected(hall: Path, file: str, text: str) -> None:
    (hall / "src" / "hall" / "vault" / file).write_text(f"#pragma once\n{text}\n")
    found = check(hall / "layers", hall)
    assert found.returncode == 1
    assert f"vault/{file}:2: hall.vault must not import hall.gallery" in found.stderr


def test_a_circle_of_includes_within_a_package_is_rejected(hall: Path) -> None:
    vault = hall / "src" / "hall" / "vault"
    (vault / "coin.hpp").write_text('#include "vault/bar.hpp"\n')
    (vault / "bar.hpp").touch()
    (vault / "bar.cpp").write_text('#include "vault/bar.hpp"\n#include "vault/coin.hpp"\n')
    found = check(hall / "layers", hall)
    assert found.returncode == 1
    assert "in a circle" in found.stderr


def test_a_folder_without_a_layer_is_rejected(hall: Path) -> None:
    (hall / "src" / "hall" / "attic").mkdir()
    (hall / "src" / "hall" / "attic" / "box.hpp").touch()
    found = check(hall / "layers", hall)
    assert "attic/box.hpp: tools/layers has no package for it" in found.stderr

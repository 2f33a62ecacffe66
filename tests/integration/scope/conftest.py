"""Fixtures: a scope of the module's `loop`, and its pages in a browser."""

from collections.abc import Iterator
from urllib.parse import quote

import pytest
from browser import Browser, Page
from daemon_process import Daemon
from scope_pages import Opener
from scope_process import ScopeProcess


@pytest.fixture(scope="module")
def scope(loop: Daemon) -> Iterator[ScopeProcess]:
    """Yield a read-only scope of `loop`; modules may override it."""
    with ScopeProcess(loop) as scope:
        yield scope


@pytest.fixture
def visit(chromium: Browser) -> Iterator[Opener]:
    """Yield a function that opens a scope's page with a layout, and closes it after the test."""
    pages = []

    def visit(scope: ScopeProcess, layout: str = "") -> Page:
        pages.append(chromium.page(scope.address + (f"#{quote(layout)}" if layout else "")))
        return pages[-1]

    yield visit
    for page in pages:
        page.close()

"""The pixels on the screen are those of the data, whatever an engineer does."""

from collections.abc import Iterator
from pathlib import Path

import pytest
import rtcf
from browser import Page
from daemon_process import Daemon
from scope_pages import Opener, add_drawing
from scope_process import ScopeProcess, looping

ACTIONS = 8  # of each seed


@pytest.fixture(scope="module")
def loop(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Daemon]:
    """Yield a daemon with a loop; the pages of these tests show cycles of their own."""
    components = [rtcf.component("rtcf_test", "Ragged", name="ragged")]
    with looping(tmp_path_factory.mktemp("loop"), components, 100.0) as daemon:
        yield daemon


@pytest.fixture
def page(visit: Opener, scope: ScopeProcess) -> Page:
    """Return a page with the helpers of `drawing`."""
    page = visit(scope)
    add_drawing(page)
    page.ask("drawing.names = Array.from({ length: 4 }, (_, i) => `/made.x${i}`)")
    return page


def _begin(page: Page, seed: int, seconds: float = 5.0) -> None:
    """Begin with one sine wave that rolls."""
    page.ask(
        f"""(async () => {{
          drawing.made?.box.remove();
          drawing.random = drawing.randomOf({seed});
          drawing.source = new drawing.Waves(drawing.names, 2000);
          drawing.made = await drawing.scopeOf([[drawing.names[0]]]);
          drawing.roll(drawing.made, drawing.source, {seconds});
        }})()"""
    )


def _misplaced(page: Page, folder: Path) -> list[dict[str, object]]:
    page.ask("drawing.shown(drawing.made, drawing.source)")
    image = page.call("Page.captureScreenshot")["data"]
    found: list[dict[str, object]] = page.ask(f"drawing.misplaced(drawing.made, '{image}')")
    if found:
        page.screenshot(folder / "misplaced.png")
    return found


def _check(page: Page, folder: Path, seed: int) -> None:
    _begin(page, seed)
    done = []
    for _ in range(ACTIONS):
        done.append(page.ask("drawing.act(drawing.made, drawing.source, drawing.random)"))
        found = _misplaced(page, folder)
        assert not found, f"seed {seed}, after {', '.join(done)}: {len(found)} pixels, {found[:3]}"


def test_a_scale_changed_after_freezing_leaves_no_old_drawing(page: Page, tmp_path: Path) -> None:
    _begin(page, 1, 30.0)
    for low, high in ((-9, 9), (-3, 3), (-40, 40), (-6, 6)):
        page.ask("drawing.made.freeze()")
        page.ask(f"drawing.made.panes[0].scale = {{ low: {low}, high: {high} }}")
        page.ask("drawing.made.changed()")
        assert _misplaced(page, tmp_path) == []
        page.ask("drawing.made.run(); drawing.roll(drawing.made, drawing.source, 2.3)")


def test_a_changed_theme_leaves_no_old_drawing(page: Page, tmp_path: Path) -> None:
    _begin(page, 1, 30.0)
    for theme in ("light", "dark", "light", "dark"):
        page.ask(f"document.documentElement.dataset.theme = '{theme}'; drawing.made.changed()")
        assert _misplaced(page, tmp_path) == []
        page.ask("drawing.roll(drawing.made, drawing.source, 2.3)")


@pytest.mark.parametrize("seed", range(1, 9))
def test_random_actions_leave_the_pixels_of_the_data(page: Page, tmp_path: Path, seed: int) -> None:
    _check(page, tmp_path, seed)


@pytest.mark.long
def test_many_random_actions_leave_the_pixels_of_the_data(page: Page, tmp_path: Path) -> None:
    for seed in range(1000, 2000):
        _check(page, tmp_path, seed)

"""Pages of a scope in a browser."""

import re
from collections.abc import Callable

from browser import Page
from pages import SUPPORT

# Opens a page: see `visit` in tests/integration/scope.
Opener = Callable[..., Page]

_DRAWING = (SUPPORT / "drawing.js").read_text()
_NAMES = re.findall(r"^export (?:async )?(?:function|class) (\w+)", _DRAWING, re.MULTILINE)


def add_drawing(page: Page) -> None:
    """Wait for the panes of a page; add the helpers of drawing.js as `drawing`."""
    page.wait("window.scope && scope.panes.every((pane) => pane.size.height > 0)")
    helpers = re.sub(r"^export ", "", _DRAWING, flags=re.MULTILINE)
    page.ask(f"(() => {{ {helpers}\nwindow.drawing = {{ {', '.join(_NAMES)} }} }})()")

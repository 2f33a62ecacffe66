"""The scope's drawing of the graph: it is as wide as its panel, and no parts overlap."""

import json
from collections.abc import Iterator
from typing import Any

import graphs
import pytest
import rtcf
from browser import Browser, Page
from daemon_process import NO_ROS, Daemon
from rtcfctl.graph.folding import Link, Sizes, place, route
from scope_process import ScopeProcess

_SIZES = Sizes(wide=150, high=40, gap_x=46, gap_y=24, lane_x=5, lane_y=4, port=6)


@pytest.fixture(scope="module")
def shared(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Daemon]:
    daemon = Daemon(tmp_path_factory.mktemp("daemon"), NO_ROS)
    daemon.start()
    yield daemon
    daemon.end()


@pytest.fixture(scope="module")
def scope(shared: Daemon) -> Iterator[ScopeProcess]:
    with ScopeProcess(shared) as scope:
        yield scope


@pytest.fixture
def size() -> tuple[int, int]:
    """Return the size of the page; some tests use several."""
    return 1280, 800


@pytest.fixture
def page(chromium: Browser, scope: ScopeProcess, size: tuple[int, int]) -> Iterator[Page]:
    page = chromium.page(scope.address, *size)
    page.wait("document.getElementById('state').textContent")
    page.ask("document.querySelector('button[data-drawer=graph]').click()")
    yield page
    page.close()


def drawn(page: Page) -> dict[str, Any]:
    """Return the boxes of components, the lines, and the sizes of the drawing and its panel."""
    found: dict[str, Any] = page.ask(
        """(() => {
          const panel = document.querySelector('div[data-drawer=graph]');
          const svg = panel.querySelector('svg'), all = (words) => [...svg.querySelectorAll(words)];
          const name = (each) => each.dataset.component;
          const box = (each) => {
            const { x, y, width, height } = each.querySelector('rect').getBoundingClientRect();
            return { x, y, width, height };
          };
          const end = (each) => each.getBBox().x + each.getBBox().width;
          const broken = (each) => each.classList.contains('broken');
          return {
            nodes: all('.node').map((each) => ({ name: name(each), ...box(each) })),
            texts: all('.node text').every((each) => end(each) <= 150),
            lines: all('.edge').map((each) => [each.dataset.from, each.dataset.to, broken(each)]),
            marks: all('.break').map((each) => each.textContent),
            wide: svg.getBoundingClientRect().width, room: panel.clientWidth,
            scrolls: panel.scrollHeight > panel.clientHeight,
            says: panel.querySelector('.says').textContent,
          };
        })()"""
    )
    return found


@pytest.mark.parametrize("size", [(1280, 800), (700, 900), (1920, 1080)])
@pytest.mark.parametrize("name", list(graphs.GRAPHS))
def test_large_graphs_are_as_wide_as_the_panel(shared: Daemon, page: Page, name: str) -> None:
    with rtcf.Client(shared.socket) as client:
        client.apply([], "rt_runner")
        client.apply(graphs.GRAPHS[name], "rt_runner")
    lines = ",".join(sorted(f"{graphs.name(a)} {graphs.name(b)}" for a, b in graphs.LINES[name]))
    page.wait(
        "document.querySelectorAll('div[data-drawer=graph] .node').length === 200 && "
        "[...document.querySelectorAll('.edge')].map((each) => "
        f"`${{each.dataset.from}} ${{each.dataset.to}}`).sort().join() === {json.dumps(lines)} && "
        "document.querySelectorAll('.break').length === "
        f"{sum(graphs.is_break(*each) for each in graphs.LINES[name])}"
    )
    found = drawn(page)
    assert found["wide"] <= found["room"]
    assert found["scrolls"]
    boxes = [(each["x"], each["y"]) for each in found["nodes"]]
    assert {(each["width"], each["height"]) for each in found["nodes"]} == {(150, 40)}
    for number, (x, y) in enumerate(boxes):
        for a, b in boxes[:number]:
            assert abs(x - a) >= 150 or abs(y - b) >= 40
    assert found["texts"]
    assert sorted(map(tuple, found["lines"])) == sorted(
        (graphs.name(a), graphs.name(b), graphs.is_break(a, b)) for a, b in graphs.LINES[name]
    )
    assert set(found["marks"]) <= {"1/z"}
    assert ("loop break" in found["says"]) == bool(found["marks"])
    assert page.errors == []


def test_a_wider_panel_has_more_columns(shared: Daemon, page: Page) -> None:
    with rtcf.Client(shared.socket) as client:
        client.apply([], "rt_runner")
        client.apply(graphs.chain(60), "rt_runner")
    page.wait("document.querySelectorAll('div[data-drawer=graph] .node').length === 60")

    for width in (900, 1600, 500):
        page.call(
            "Emulation.setDeviceMetricsOverride", width=width, height=800, deviceScaleFactor=1,
            mobile=False,
        )  # fmt: skip
        most = max(3, (width - 46) // 196)
        page.wait(
            "new Set([...document.querySelectorAll('div[data-drawer=graph] .node')].map((each) => "
            f"each.getBoundingClientRect().x)).size === {most}"
        )
        assert drawn(page)["wide"] <= max(drawn(page)["room"], 3 * 196 + 46)


def test_positions_and_lines_match_the_command_line(page: Page) -> None:
    page.ask("import('/page/panels/graph_layout.js').then((found) => { window.layout = found; })")
    sizes = "{ wide: 150, high: 40, gapX: 46, gapY: 24, laneX: 5, laneY: 4, port: 6 }"
    for name, lines in graphs.LINES.items():
        names = [graphs.name(number) for number in range(200)]
        links = [
            Link(f"/s{a}", graphs.name(a), graphs.name(b), graphs.is_break(a, b)) for a, b in lines
        ] + [Link(f"/t{a}", None, graphs.name(a)) for a in range(0, 200, 7)]
        told = json.dumps([vars(each) for each in links])
        for columns in (3, 6, 9):
            cells = place(names, links, columns)
            ways = route(cells, links, _SIZES)
            found = page.ask(
                f"""(() => {{
                  const links = {told}, cells = layout.place({json.dumps(names)}, links, {columns});
                  return [[...cells], layout.route(cells, links, {sizes})];
                }})()"""
            )
            assert {key: tuple(value.values()) for key, value in found[0]} == {
                key: (each.column, each.row, each.turned) for key, each in cells.items()
            }, (name, columns)
            assert [[tuple(corner) for corner in way] for way in found[1]] == [
                [pytest.approx(corner) for corner in way] for way in ways
            ], (name, columns)

"""Positions and lines of graph drawings: no parts overlap."""

import itertools
import math

import pytest
from hypothesis import given
from hypothesis import strategies as st
from rtcfctl.graph.folding import Cell, Link, Sizes, place, route, shape

SIZES = Sizes(wide=150, high=40, gap_x=46, gap_y=24, lane_x=5, lane_y=4, port=6)


@st.composite
def graphs(draw: st.DrawFn) -> tuple[list[str], list[Link]]:
    """Draw components in the order of their schedule, and their connections."""
    names = [f"/c{number}" for number in range(draw(st.integers(1, 60)))]
    links = []
    for number in range(draw(st.integers(0, 120))):
        writer = draw(st.integers(-1, len(names) - 1))
        reader = draw(st.integers(0, len(names) - 1))
        net = f"/s{writer if writer >= 0 else f'outside{number}'}"
        source = names[writer] if writer >= 0 else None
        links.append(Link(net, source, names[reader], writer >= reader))
    return names, links


def chain(count: int) -> tuple[list[str], list[Link]]:
    names = [f"/c{number}" for number in range(count)]
    return names, [Link(f"/{a}", a, b) for a, b in itertools.pairwise(names)]


def size(cells: dict[str, Cell]) -> tuple[int, int]:
    """Return columns and rows."""
    places = cells.values()
    return 1 + max(each.column for each in places), 1 + max(each.row for each in places)


@given(graph=graphs(), columns=st.integers(2, 12))
def test_each_component_has_its_own_position(
    graph: tuple[list[str], list[Link]], columns: int
) -> None:
    names, links = graph
    cells = place(names, links, columns)
    assert sorted(cells) == sorted(names)
    assert len({(each.column, each.row) for each in cells.values()}) == len(names)
    assert size(cells)[0] <= columns


@given(graph=graphs(), columns=st.integers(2, 12))
def test_no_line_crosses_a_box(graph: tuple[list[str], list[Link]], columns: int) -> None:
    names, links = graph
    cells = place(names, links, columns)
    boxes = [(SIZES.left(each.column), SIZES.top(each.row)) for each in cells.values()]
    wide, high = (SIZES.left(size(cells)[0]), SIZES.top(size(cells)[1]))
    for link, way in zip(links, route(cells, links, SIZES), strict=True):
        for (x1, y1), (x2, y2) in itertools.pairwise(way):
            assert x1 == x2 or y1 == y2
            for x, y in boxes:
                outside = (
                    max(x1, x2) <= x
                    or min(x1, x2) >= x + SIZES.wide
                    or max(y1, y2) <= y
                    or min(y1, y2) >= y + SIZES.high
                )
                assert outside, (link, (x1, y1), (x2, y2), (x, y))
            assert min(x1, x2) >= 0 and max(x1, x2) <= wide
            assert min(y1, y2) >= 0 and max(y1, y2) <= high
        to = cells[link.reader]
        # It ends at its reader, and arrives from outside the box.
        side = SIZES.left(to.column) + (SIZES.wide if to.turned else 0.0)
        assert way[-1][0] == side
        assert (way[-2][0] > side) == to.turned
        assert SIZES.top(to.row) < way[-1][1] < SIZES.top(to.row) + SIZES.high


@given(count=st.integers(1, 300), columns=st.integers(2, 20))
def test_a_chain_is_folded_into_rows(count: int, columns: int) -> None:
    names, links = chain(count)
    cells = place(names, links, columns)
    wide, high = size(cells)
    assert (wide, high) == (math.ceil(count / high), math.ceil(count / columns))
    for a, b in itertools.pairwise(cells[each] for each in names):
        if a.row == b.row:
            assert b.column == a.column + (-1 if a.turned else 1)
        else:
            assert (b.column, b.row, b.turned) == (a.column, a.row + 1, not a.turned)
    for way in route(cells, links, SIZES):
        assert len(way) in (2, 4)  # straight, or with one detour


@given(graph=graphs())
def test_values_flow_to_the_right_within_a_row(graph: tuple[list[str], list[Link]]) -> None:
    names, links = graph
    cells = place(names, links, len(names) + 1)
    assert not any(each.turned for each in cells.values())
    for link in links:
        if link.writer is not None and not link.broken:
            assert cells[link.writer].column < cells[link.reader].column


@given(graph=graphs(), columns=st.integers(2, 12))
def test_layers_follow_the_longest_path(graph: tuple[list[str], list[Link]], columns: int) -> None:
    names, links = graph
    longest = dict.fromkeys(names, 1)
    for name in names:
        for link in links:
            if link.reader == name and link.writer is not None and not link.broken:
                longest[name] = max(longest[name], longest[link.writer] + 1)
    assert shape(names, links)[0] == max(longest.values())


@pytest.mark.parametrize("columns", [3, 6, 9])
def test_many_readers_of_one_writer_form_a_block(columns: int) -> None:
    names = [f"/c{number}" for number in range(200)]
    cells = place(names, [Link("/s", names[0], each) for each in names[1:]], columns)
    wide, high = size(cells)
    assert wide == columns
    assert high == math.ceil(199 / (columns - 1))


def test_chains_are_placed_below_each_other() -> None:
    names = [f"/c{number}" for number in range(200)]
    links = [Link(f"/{a}", a, b) for a, b in itertools.pairwise(names) if not b.endswith("0")]
    cells = place(names, links, 12)
    assert size(cells) == (10, 20)
    assert [cells[each].row for each in names] == [number // 10 for number in range(200)]

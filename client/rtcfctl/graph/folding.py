"""Layout of large graphs on a grid of boxes.

Values flow from left to right; a chain longer than a row continues in the next row in the opposite
direction.  Lines run in the gaps between the boxes.

Pure functions.  The scope's page has the same layout in JavaScript (page/panels/graph_layout.js).
"""

import math
from collections import defaultdict
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

_ROWS = 8  # largest layer, in components, that has only one column
# Lanes of parallel lines in a gap, from its middle outwards.
_LANES_DOWN = (0, 1, -1, 2, -2, 3, -3)
_LANES_ACROSS = (0, 1, -1, 2, -2)

Point = tuple[float, float]  # distance from the left, from the top


@dataclass(frozen=True)
class Link:
    """One reader of a connection."""

    net: str  # connection and writer; lines of the same net may overlap
    writer: str | None  # None: outside the loop
    reader: str
    broken: bool = False  # loop break: it has the value of the previous cycle


@dataclass(frozen=True)
class Cell:
    """The grid position of a component."""

    column: int
    row: int
    turned: bool = False  # values flow from right to left in this row


@dataclass(frozen=True)
class Sizes:
    """Sizes of boxes and of the gaps between them, in any unit of length."""

    wide: float
    high: float
    gap_x: float
    gap_y: float
    lane_x: float  # distance of lines in a gap
    lane_y: float
    port: float  # distance of lines at a box

    def left(self, column: int) -> float:
        """Return the left edge of a column's boxes."""
        return self.gap_x + column * (self.wide + self.gap_x)

    def top(self, row: int) -> float:
        """Return the upper edge of a row's boxes."""
        return self.gap_y + row * (self.high + self.gap_y)


def place(names: Sequence[str], links: Iterable[Link], columns: int) -> dict[str, Cell]:
    """Return the cell of each component.

    `names` are in the order in which the components run; `columns` is the largest number of
    columns, at least 2.
    """
    links = list(links)
    found: dict[str, Cell] = {}
    column = row = below = 0
    for island in _islands(names, links):
        cells = _place_island(island, links, columns)
        wide = 1 + max(each.column for each in cells.values())
        if column + wide > columns:
            column, row = 0, below
        for name, cell in cells.items():
            found[name] = Cell(column + cell.column, row + cell.row, cell.turned)
            below = max(below, row + cell.row + 1)
        column += wide
    return found


def shape(names: Sequence[str], links: Iterable[Link]) -> tuple[int, int]:
    """Return the number of layers of a graph and the number of components in its largest layer."""
    layers: dict[int, int] = defaultdict(int)
    for each in _layers(names, list(links)).values():
        layers[each] += 1
    return len(layers), max(layers.values(), default=0)


def _islands(names: Sequence[str], links: Sequence[Link]) -> list[list[str]]:
    """Return the connected groups of components; single components are last."""
    group = {name: [name] for name in names}
    for link in links:
        if link.writer is None or group[link.writer] is group[link.reader]:
            continue
        less, more = sorted((group[link.writer], group[link.reader]), key=len)
        more += less
        for name in less:
            group[name] = more
    place = {name: number for number, name in enumerate(names)}
    islands = {id(each): sorted(each, key=place.__getitem__) for each in group.values()}
    return sorted(islands.values(), key=lambda each: (len(each) == 1, place[each[0]]))


def _layers(names: Sequence[str], links: Sequence[Link]) -> dict[str, int]:
    """Return the layer of each component: the longest path to it, without loop breaks."""
    sources: dict[str, list[str]] = {name: [] for name in names}
    readers: dict[str, list[str]] = {name: [] for name in names}
    for link in links:
        if link.broken or link.writer == link.reader:
            continue
        if link.writer in sources and link.reader in sources:
            sources[link.reader].append(link.writer)
            readers[link.writer].append(link.reader)
    found: dict[str, int] = {}
    for name in names:
        found[name] = 1 + max((found.get(each, -1) for each in sources[name]), default=-1)
    # A component without inputs from others is in the layer before its first reader.
    for name in names:
        if not sources[name] and readers[name]:
            found[name] = max(0, min(found[each] for each in readers[name]) - 1)
    return found


def _place_island(names: Sequence[str], links: Sequence[Link], columns: int) -> dict[str, Cell]:
    inside = set(names)
    links = [each for each in links if each.reader in inside and each.writer in inside]
    layers: dict[int, list[str]] = defaultdict(list)
    for name, number in _layers(names, links).items():
        layers[number].append(name)
    most = max(map(len, layers.values()))
    most_rows = max(_ROWS, math.ceil(most / max(columns - 1, 1)))
    sources: dict[str, list[str]] = defaultdict(list)
    for link in links:
        if link.writer is not None and not link.broken:
            sources[link.reader].append(link.writer)
    rows: dict[str, int] = {}
    blocks: list[list[list[str]]] = []  # the columns of each layer
    for number in sorted(layers):
        wanted = {
            name: _mean([rows[each] for each in sources[name] if each in rows])
            for name in layers[number]
        }
        order = sorted(layers[number], key=wanted.__getitem__)
        block = []
        for begin in range(0, len(order), most_rows):
            column = order[begin : begin + most_rows]
            rows.update(_rows(column, wanted, most_rows))
            block.append(column)
        blocks.append(block)
    bands = _bands(blocks, columns)
    wide = max(map(len, bands))
    cells: dict[str, Cell] = {}
    top = 0
    for number, band in enumerate(bands):
        inside_band = [rows[name] for column in band for name in column]
        first = min(inside_band)
        for at, column in enumerate(band):
            for name in column:
                turned = number % 2 == 1
                row = top + rows[name] - first
                cells[name] = Cell(wide - 1 - at if turned else at, row, turned)
        top += max(inside_band) - first + 1
    return cells


def _rows(column: Sequence[str], wanted: dict[str, float], most: int) -> dict[str, int]:
    """Return the row of each component of a column, near the mean row of its writers."""
    rows: list[int] = []
    for name in column:
        rows.append(max(math.floor(wanted[name] + 0.5), rows[-1] + 1 if rows else 0))
    last = max(most, len(column)) - 1
    for at in range(len(rows) - 1, -1, -1):
        rows[at] = min(rows[at], last)
        last = rows[at] - 1
    return dict(zip(column, rows, strict=True))


def _bands(blocks: Sequence[list[list[str]]], columns: int) -> list[list[list[str]]]:
    """Split the layers into bands of similar width, each of at most `columns` columns."""
    total = sum(map(len, blocks))
    room = math.ceil(total / math.ceil(total / columns))
    bands: list[list[list[str]]] = [[]]
    for block in blocks:
        if bands[-1] and len(bands[-1]) + len(block) > max(room, len(block)):
            bands.append([])
        bands[-1] += block
    return bands


def _mean(numbers: Sequence[int]) -> float:
    return sum(numbers) / len(numbers) if numbers else 0.0


class _Lanes:
    """Lanes of lines in gaps.  Lines of different nets overlap only if all lanes are taken."""

    def __init__(self, numbers: Sequence[int]) -> None:
        self._numbers = numbers
        self._used: dict[tuple[int, int], list[tuple[float, float, str]]] = defaultdict(list)
        self._nets: dict[str, int] = {}

    def take(self, gap: int, begin: float, end: float, net: str) -> int:
        """Reserve a lane for a line from `begin` to `end` in a gap; return it."""
        begin, end = min(begin, end), max(begin, end)
        for lane in self._numbers:
            beside = [each for each in self._used[gap, lane] if each[0] <= end and begin <= each[1]]
            if all(each[2] == net for each in beside):
                break
        else:
            lane = self._numbers[self._nets.setdefault(net, len(self._nets)) % len(self._numbers)]
        self._used[gap, lane].append((begin, end, net))
        return lane


def route(cells: dict[str, Cell], links: Sequence[Link], sizes: Sizes) -> list[list[Point]]:
    """Return the corners of each link from writer to reader.  No line crosses a box."""
    outs = _ports(((each.writer, each.net) for each in links), sizes)
    ins = _ports(((each.reader, each.net) for each in links), sizes)
    down, across = _Lanes(_LANES_DOWN), _Lanes(_LANES_ACROSS)
    ways = []
    for link in links:
        to = cells[link.reader]
        gap_to = to.column + to.turned
        x2 = sizes.left(to.column) + (sizes.wide if to.turned else 0.0)
        y2 = sizes.top(to.row) + sizes.high / 2 + ins[link.reader, link.net]
        if link.writer is None:
            ways.append([(_middle(gap_to, sizes), y2), (x2, y2)])
            continue
        start = cells[link.writer]
        gap = start.column + (not start.turned)
        x1 = sizes.left(start.column) + (0.0 if start.turned else sizes.wide)
        y1 = sizes.top(start.row) + sizes.high / 2 + outs[link.writer, link.net]
        if gap == gap_to:
            if y1 == y2 and x1 != x2:
                ways.append([(x1, y1), (x2, y2)])
                continue
            x = _middle(gap, sizes) + sizes.lane_x * down.take(gap, y1, y2, link.net)
            ways.append([(x1, y1), (x, y1), (x, y2), (x2, y2)])
            continue
        # The line runs above the reader's row, or below it if it comes from below or goes back.
        above = to.row > start.row or (to.row == start.row and not link.broken)
        aisle = to.row + (not above)
        lane = across.take(aisle, _middle(gap, sizes), _middle(gap_to, sizes), link.net)
        y = sizes.top(aisle) - sizes.gap_y / 2 + sizes.lane_y * lane
        xa = _middle(gap, sizes) + sizes.lane_x * down.take(gap, y1, y, link.net)
        xb = _middle(gap_to, sizes) + sizes.lane_x * down.take(gap_to, y, y2, link.net)
        ways.append([(x1, y1), (xa, y1), (xa, y), (xb, y), (xb, y2), (x2, y2)])
    return ways


def _middle(gap: int, sizes: Sizes) -> float:
    return sizes.left(gap) - sizes.gap_x / 2


def _ports(
    ends: Iterable[tuple[str | None, str]], sizes: Sizes
) -> dict[tuple[str | None, str], float]:
    """Return the offset of each net's end from the middle of the box, by component and net."""
    nets: dict[str | None, dict[str, None]] = defaultdict(dict)
    for component, net in ends:
        nets[component][net] = None
    found = {}
    for component, names in nets.items():
        step = min(sizes.port, 0.7 * sizes.high / len(names))
        for number, net in enumerate(names):
            found[component, net] = (number - (len(names) - 1) / 2) * step
    return found

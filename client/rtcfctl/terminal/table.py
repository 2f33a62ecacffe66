"""Tables for people: columns fit their contents; text is folded to the width of the terminal.

Pure functions.
"""

import textwrap
from collections.abc import Iterator, Sequence

Cell = tuple[str, str]  # text, style
_WIDE_GAP, _NARROW_GAP = 2, 1
_LEAST = 6  # smallest width of a folded column
_LEAST_OF_HEADING = 14  # a heading keeps its column as wide as itself, up to this width


def format_table(
    columns: Sequence[str],
    rows: Sequence[Sequence[Cell]],
    right: Sequence[str] = (),
    width: int | None = None,
) -> Iterator[list[Cell]]:
    """Yield the lines of a table, each as cells with their styles.

    Columns that are empty in all rows are left out.  With `width`, columns of text are folded,
    the widest first; columns of numbers (named by `right`) are not.
    """
    used = [i for i in range(len(columns)) if not rows or any(row[i][0] for row in rows)]
    names = [columns[i] for i in used]
    table = [[row[i] for i in used] for row in rows]
    widths = [max([len(name), *(len(row[i][0]) for row in table)]) for i, name in enumerate(names)]
    gap = _WIDE_GAP
    if width is not None:
        if sum(widths) + gap * (len(widths) - 1) > width:
            gap = _NARROW_GAP
        texts = [i for i, name in enumerate(names) if name not in right]
        _fold(widths, texts, width - gap * (len(widths) - 1), names)
    yield from _row([(name, "bold") for name in names], names, widths, right, gap)
    for row in table:
        yield from _row(row, names, widths, right, gap)


def _fold(widths: list[int], texts: Sequence[int], room: int, names: Sequence[str]) -> None:
    """Reduce the widths of text columns until the table fits, or all have their smallest width."""
    while sum(widths) > room:
        able = [i for i in texts if widths[i] > max(_LEAST, min(len(names[i]), _LEAST_OF_HEADING))]
        if not able:
            return
        widest = max(able, key=lambda i: widths[i])
        widths[widest] -= 1


def _row(
    cells: Sequence[Cell],
    names: Sequence[str],
    widths: Sequence[int],
    right: Sequence[str],
    gap: int,
) -> Iterator[list[Cell]]:
    folded = [_lines(text, room) for (text, _), room in zip(cells, widths, strict=True)]
    for number in range(max(map(len, folded))):
        line: list[Cell] = []
        for (_, style), lines, name, room in zip(cells, folded, names, widths, strict=True):
            text = lines[number] if number < len(lines) else ""
            if line:
                line.append((" " * gap, ""))
            line.append((text.rjust(room) if name in right else text.ljust(room), style))
        yield line


def _lines(text: str, room: int) -> list[str]:
    if len(text) <= room and "\n" not in text:
        return [text]
    # Break lines at spaces; break a word that is longer than the column.
    return [line for part in text.split("\n") for line in textwrap.wrap(part, room) or [""]]

"""Result of a benchmark: a table, and its budgets."""

from dataclasses import asdict, dataclass, field
from typing import Any

Cell = str | float | int | None


@dataclass
class Budget:
    """A measurement and its limit. A benchmark reports it and asserts nothing."""

    text: str
    measured: float
    limit: float
    unit: str

    @property
    def kept(self) -> bool:
        """Return whether the measurement is within the limit."""
        return self.measured <= self.limit


@dataclass
class Result:
    """The result of one benchmark."""

    name: str
    title: str
    columns: list[str] = field(default_factory=list)
    rows: list[list[Cell]] = field(default_factory=list)
    budgets: list[Budget] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)
    skipped: str = ""  # reason for not running; empty = it ran

    def as_json(self) -> dict[str, Any]:
        """Return the content for results.json."""
        content = asdict(self)
        for budget, written in zip(self.budgets, content["budgets"], strict=True):
            written["kept"] = budget.kept
        return content

    def as_text(self) -> str:
        """Return the text for the terminal."""
        lines = ["", f"== {self.title}"]
        if self.skipped:
            lines.append(f"not run: {self.skipped}")
        if self.rows:
            table = [self.columns, *([_text(cell) for cell in row] for row in self.rows)]
            widths = [max(len(row[i]) for row in table) for i in range(len(self.columns))]
            for row in table:
                first, *others = (
                    cell.rjust(width) if i else cell.ljust(width)
                    for i, (cell, width) in enumerate(zip(row, widths, strict=True))
                )
                lines.append("  ".join([first, *others]).rstrip())
        for budget in self.budgets:
            verdict = "met" if budget.kept else "EXCEEDED"
            lines.append(
                f"budget {verdict}: {budget.text}: {_text(budget.measured)} of "
                f"{_text(budget.limit)} {budget.unit}"
            )
        lines += self.notes
        return "\n".join(lines)


def _text(cell: Cell) -> str:
    if cell is None:
        return "-"
    if isinstance(cell, float):
        return f"{cell:.4g}" if abs(cell) < 1000 else f"{cell:.0f}"
    return str(cell)

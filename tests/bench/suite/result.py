"""What a bench found: figures as a table, and the budgets they are held against."""

from dataclasses import asdict, dataclass, field
from typing import Any

Cell = str | float | int | None


@dataclass
class Budget:
    """One limit and what was measured; a bench reports, it does not assert."""

    text: str
    measured: float
    limit: float
    unit: str

    @property
    def kept(self) -> bool:
        """Tell whether the figure is within the limit."""
        return self.measured <= self.limit


@dataclass
class Result:
    """The outcome of one bench."""

    name: str
    title: str
    columns: list[str] = field(default_factory=list)
    rows: list[list[Cell]] = field(default_factory=list)
    budgets: list[Budget] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)
    skipped: str = ""  # why it did not run; empty = it ran

    def as_json(self) -> dict[str, Any]:
        """Return it for the file of results."""
        content = asdict(self)
        for budget, written in zip(self.budgets, content["budgets"], strict=True):
            written["kept"] = budget.kept
        return content

    def as_text(self) -> str:
        """Return it for a person."""
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
            verdict = "kept" if budget.kept else "NOT KEPT"
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

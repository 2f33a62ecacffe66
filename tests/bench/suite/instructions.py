"""Number of instructions per cycle: exact, independent of the machine's load."""

import json
from dataclasses import dataclass

from processes import output_of
from result import Budget, Result
from setting import Setting

FIG_1_INSTRUCTIONS = 280.0  # LinuxCNC HAL: 240 for plain sums, 348 for the same as Mimo
_PUBLISHED = 3
_TITLES = {
    "1": "chain of 1",
    "2": "chain of 2",
    "10": "chain of 10",
    "fig1": "Fig. 1",
    "published": "Fig. 1 with 3 published outputs",
    "subscribed": "Fig. 1 with a subscribed input",
    "message": "Fig. 1 with a message for that input in each cycle",
}


@dataclass(frozen=True)
class Counts:
    """Instructions per cycle of one graph."""

    calculation: float  # from the end of the wait to the end of the cycle
    largest: int
    whole: float  # of a step, the pacing included


def count(setting: Setting, graph: str) -> Counts:
    """Single-step the executor's loop.  Raises Failed."""
    command = [setting.program("instruction_count"), str(setting.library), graph]
    found = json.loads(output_of(command))
    return Counts(found["instructions"], found["max"], found["whole"])


def budgets(counts: dict[str, Counts]) -> list[Budget]:
    """Compute the results that have a budget, named as in docs/performance.md."""
    fig_1 = counts["fig1"]
    # Work after the cycle counts, too.
    output = (counts["published"].whole - fig_1.whole) / _PUBLISHED
    subscribed = counts["subscribed"].whole - fig_1.whole
    message = counts["message"].whole - fig_1.whole
    chain = (counts["10"].calculation - counts["2"].calculation) / 8
    return [
        Budget("Fig. 1", fig_1.calculation, FIG_1_INSTRUCTIONS, "instructions"),
        Budget("one more component", chain, 36.0, "instructions"),
        Budget("each published output on top", output, 0.0, "instructions"),
        Budget("a subscribed input on top, without a message", subscribed, 0.0, "instructions"),
        Budget("the same with a message in each cycle", message, 0.0, "instructions"),
    ]


def run(setting: Setting) -> Result:
    """Count by single-stepping the executor's loop."""
    result = Result(
        "instructions",
        "instructions per cycle: from the end of the wait to the end of the cycle, and whole",
        ["graph", "instructions", "max", "whole"],
    )
    counts = {graph: count(setting, graph) for graph in _TITLES}
    for graph, title in _TITLES.items():
        found = counts[graph]
        result.rows.append([title, found.calculation, found.largest, found.whole])
    result.budgets = budgets(counts)
    return result

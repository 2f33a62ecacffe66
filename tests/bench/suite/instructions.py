"""How many instructions a cycle takes: exact, whatever the machine is doing."""

import json

from processes import output_of
from result import Budget, Result
from setting import Setting

FIG_1_INSTRUCTIONS = 315.0  # LinuxCNC HAL takes 240 for plain sums, 348 for what Mimo does
PER_MAPPED_PORT = 100.0
FRAMES = 80.0
_MAPPED_PORTS = 3


def run(setting: Setting) -> Result:
    """Count by single-stepping the executor's loop."""
    result = Result(
        "instructions",
        "instructions of a cycle: from the end of the wait to before the cycle record, and whole",
        ["graph", "instructions", "max", "whole"],
    )
    counts: dict[str, float] = {}
    whole: dict[str, float] = {}
    titles = {
        "1": "chain of 1",
        "2": "chain of 2",
        "10": "chain of 10",
        "fig1": "Fig. 1",
        "frames": "Fig. 1 with frames",
        "mapped": "Fig. 1 with 3 mapped ports, a message in each cycle",
    }
    for graph, title in titles.items():
        command = [setting.program("instruction_count"), str(setting.library), graph]
        found = json.loads(output_of(command))
        counts[graph] = found["instructions"]
        whole[graph] = found["whole"]
        result.rows.append([title, found["instructions"], found["max"], found["whole"]])
    ports = (whole["mapped"] - whole["fig1"]) / _MAPPED_PORTS
    result.budgets = [
        Budget("Fig. 1", counts["fig1"], FIG_1_INSTRUCTIONS, "instructions"),
        Budget("frames on top", whole["frames"] - whole["fig1"], FRAMES, "instructions"),
        Budget("each mapped port on top", ports, PER_MAPPED_PORT, "instructions"),
    ]
    return result

"""What update() takes of components in Python, against the same in C++ with Eigen."""

import json
from pathlib import Path

from processes import output_of
from result import Budget, Result
from setting import Setting

SOURCE = Path(__file__).parents[2] / "components" / "python" / "filters.py"
TYPES = ("Pid", "Kalman", "Solver")
AT_MOST = 2.5


def run(setting: Setting) -> Result:
    """Compile them, and measure both in turn."""
    library = setting.output / "filters.so"
    output_of([str(setting.build / "bin/rtcf-compile"), str(SOURCE), "-o", str(library)])
    reference = setting.build / "lib/rtcf/rtcf_bench/rtcf_bench_filters.so"
    found = json.loads(
        output_of([setting.program("update_cost"), str(library), str(reference), *TYPES])
    )
    result = Result(
        "python_components",
        "update() of components in Python, compiled, against the same in C++ with Eigen",
        ["component", "Python ns", "C++ ns", "ratio"],
    )
    for each in found["types"]:
        ratio = each["ns"] / each["reference_ns"]
        result.rows.append([each["type"], each["ns"], each["reference_ns"], ratio])
        result.budgets.append(
            Budget(f"{each['type']} in Python, against C++", ratio, AT_MOST, "times")
        )
    result.notes.append(
        f"medians of {found['rounds']} rounds of {found['updates']} updates, in turn, on the same "
        "inputs, which are written before each; indices are checked in Python alone"
    )
    return result

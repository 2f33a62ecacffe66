"""Time of the cycle that adopts a change, by the size of the graph."""

import json

from processes import output_of
from result import Budget, Result
from setting import Setting


def run(setting: Setting) -> Result:
    """Change graphs of 10 to 4000 components, with cold caches."""
    found = json.loads(output_of([setting.program("adoption_cost"), str(setting.library)]))
    result = Result(
        "adoption_cost",
        "time to adopt a change, within the cycle, cold caches",
        ["components", "set ns", "load ns", "unload ns"],
    )
    for graph in found["graphs"]:
        result.rows.append(
            [graph["components"], graph["set_ns"], graph["load_ns"], graph["unload_ns"]]
        )
    result.budgets.append(
        Budget("one parameter at 4000 components", found["graphs"][-1]["set_ns"], 5000.0, "ns")
    )
    result.notes.append(f"medians of {found['rounds']} changes of each kind")
    return result

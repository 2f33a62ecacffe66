"""Overhead of the framework per component, against direct calls of the same update()."""

import json

from processes import output_of
from result import Budget, Result
from setting import Setting


def run(setting: Setting) -> Result:
    """Measure chains of 1 to 1000 components, without pacing."""
    found = json.loads(output_of([setting.program("component_cost"), str(setting.library)]))
    result = Result(
        "component_cost",
        "time per component: rtcf's loop against a plain loop over the same update(), warm",
        ["chain", "loop ns", "direct ns", "framework ns", "per added component", "undisturbed"],
    )
    for chain in found["chains"]:
        result.rows.append(
            [
                chain["length"],
                chain["loop_ns"],
                chain["direct_ns"],
                chain["framework_ns"],
                chain["per_component_ns"] if chain["length"] > 1 else None,
                chain["undisturbed_ns"] if chain["length"] > 1 else None,
            ]
        )
        if chain["length"] > 1:
            result.budgets.append(
                Budget(
                    f"chain of {chain['length']}, limit: a counter read + 5 ns",
                    chain["undisturbed_ns"],
                    found["budget_ns"],
                    "ns",
                )
            )
    result.notes.append(
        f"one counter read takes {found['counter_read_ns']:.1f} ns; medians of "
        f"{found['rounds']} interleaved rounds; the chain of 1 shows the fixed time of a cycle"
    )
    result.notes.append(
        "undisturbed: the best tenth of the rounds, to which the budgets apply: other "
        "against: where others use the core in between, its caches are not warm"
    )
    return result

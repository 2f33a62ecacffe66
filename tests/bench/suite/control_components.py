"""Duration of update() of control components: rtcf_control beside LinuxCNC HAL."""

import json
from pathlib import Path

from processes import output_of
from result import Budget, Result
from setting import Setting

MODULES = Path("/usr/lib/linuxcnc/modules")


def run(setting: Setting) -> Result:
    """Measure both, alternating, in one process."""
    result = Result(
        "control_components",
        "update() of control components: rtcf_control and LinuxCNC HAL alternating",
        ["component", "rtcf ns", "HAL's", "HAL ns", "ratio"],
    )
    if not MODULES.is_dir():
        result.skipped = "not installed: linuxcnc-uspace"
        return result
    found = json.loads(output_of([setting.program("control_cost"), str(MODULES)]))
    for each in found["rows"]:
        ratio = each["ns"] / each["reference_ns"]
        result.rows.append(
            [each["name"], each["ns"], each["reference"], each["reference_ns"], ratio]
        )
        result.budgets.append(
            Budget(f"{each['name']}, HAL's {each['reference']} as the limit", ratio, 1.0, "times")
        )
    same = [each["name"] for each in found["rows"] if each["compared"]]
    result.notes.append(
        f"medians of {found['rounds']} rounds of {found['updates']} updates on the same inputs, "
        "new for each update; writing the inputs excluded. rtcf's durations include the check "
        f"that outputs are finite. {', '.join(same)}: the outputs of {found['compared']} updates "
        f"were the same within {found['tolerance']:g}"
    )
    result.notes.append(
        "TrajectoryGenerator also limits the jerk and writes messages; limit3 writes a number"
    )
    return result

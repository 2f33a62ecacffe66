"""Duration of update() of example controllers, and of banks of filters on rows and columns of
matrices: compiled Python against C++ with Eigen.
"""

import json
from pathlib import Path

from processes import output_of
from result import Budget, Result
from setting import Setting

_TREE = Path(__file__).parents[3]
_EXAMPLES = _TREE / "components" / "rtcf_examples" / "python"
_BANKS = _TREE / "tests" / "bench" / "components" / "notch_bank.py"
# By file name: type, and limit of the duration as a multiple of C++'s.
CONTROLLERS = {
    "butterworth": ("Butterworth", 2.0),
    "disturbance_observer": ("DisturbanceObserver", 2.0),
    "gravity_pd": ("GravityPd", 2.0),
    "interpolator": ("Interpolator", 2.0),
    "kalman": ("Kalman", 2.0),
    "lookup": ("Lookup", 2.0),
    "lqr": ("Lqr", 2.0),
    "madgwick": ("Madgwick", 2.0),
    "mpc": ("Mpc", 1.5),
    "pid": ("Pid", 2.0),
    "ring_buffer": ("RingBuffer", 2.0),
    "s_curve": ("SCurve", 2.0),
}
# Limits by type.
BANKS = {"NotchRows": 2.0, "NotchColumns": 2.0, "NotchSections": 2.0, "NotchCascade": 2.0}


def run(setting: Setting) -> Result:
    """Compile the components in Python and measure both, alternating."""
    library = setting.output / "controllers.so"
    sources = [str(_EXAMPLES / f"{name}.py") for name in CONTROLLERS]
    sources.append(str(_BANKS))
    output_of([str(setting.build / "bin/rtcf-compile"), *sources, "-o", str(library)], 120.0)
    reference = setting.build / "lib/rtcf/rtcf_bench/rtcf_bench_controllers.so"
    at_most = {**dict(CONTROLLERS.values()), **BANKS}
    found = json.loads(
        output_of([setting.program("update_cost"), str(library), str(reference), *at_most])
    )
    result = Result(
        "python_components",
        "update() of controllers: compiled Python against C++ with Eigen, -O2",
        ["controller", "Python ns", "C++ ns", "ratio"],
    )
    for each in found["types"]:
        name, ratio = each["type"], each["ns"] / each["reference_ns"]
        result.rows.append([name, each["ns"], each["reference_ns"], ratio])
        result.budgets.append(
            Budget(f"{name} in Python, against C++", ratio, at_most[name], "times")
        )
    result.notes.append(
        f"medians of {found['rounds']} rounds of {found['updates']} updates, alternating, on the "
        f"same inputs, new for each update; writing the inputs excluded. The outputs of "
        f"{found['compared']} updates were the same within {found['tolerance']:g}. Indices are "
        "checked in Python only"
    )
    return result

"""From functions to an object file, and the gate that it has to pass."""

import os

# Read when numba is imported: code for this machine alone would not run on the robot's.
os.environ["NUMBA_CPU_NAME"] = "generic"
os.environ["NUMBA_CPU_FEATURES"] = ""

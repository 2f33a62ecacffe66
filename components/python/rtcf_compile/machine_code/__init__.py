"""From functions to an object file, and the gate that it has to pass."""

import os

# Read when numba is imported: code for this machine alone would not run on the robot's.
os.environ["NUMBA_CPU_NAME"] = "generic"
os.environ["NUMBA_CPU_FEATURES"] = ""
# All of a component is made fast as one module, in the end: sizes are constants only where all of it
# is inlined.
os.environ["NUMBA_OPT"] = "1"
os.environ["NUMBA_LOOP_VECTORIZE"] = os.environ["NUMBA_SLP_VECTORIZE"] = "0"

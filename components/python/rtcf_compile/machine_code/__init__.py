"""From functions to an object file, and the gate that it has to pass."""

import os

# Read when numba is imported: code for this machine alone would not run on the robot's.
os.environ["NUMBA_CPU_NAME"] = "generic"
os.environ["NUMBA_CPU_FEATURES"] = ""
# A component is optimised as one module at the end, where sizes are constants: numba's own passes
# only take time.
os.environ["NUMBA_OPT"] = "1"
os.environ["NUMBA_LOOP_VECTORIZE"] = os.environ["NUMBA_SLP_VECTORIZE"] = "0"

"""Compiles functions to an object file, and checks its references."""

import os

# numba reads these at import. Code for this machine's processor might not run on the robot's.
os.environ["NUMBA_CPU_NAME"] = "generic"
os.environ["NUMBA_CPU_FEATURES"] = ""
# A component is optimised as one module at the end, when sizes are constants, so numba's own passes
# are a waste of time.
os.environ["NUMBA_OPT"] = "1"
os.environ["NUMBA_LOOP_VECTORIZE"] = os.environ["NUMBA_SLP_VECTORIZE"] = "0"

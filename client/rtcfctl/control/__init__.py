"""Commands that identify a plant and tune its controller."""

import os

# Before NumPy is loaded. The matrices are small: threads of OpenBLAS cost more than they gain, and
# on a busy machine they wait for each other.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

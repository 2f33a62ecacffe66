"""`python3 -m rtcf_compile`."""

import sys

from rtcf_compile.guarded import guarded

sys.exit(guarded())

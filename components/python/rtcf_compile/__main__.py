"""`python3 -m rtcf_compile`."""

import sys

from rtcf_compile.main import main

sys.exit(main())

"""`python3 -m rtcfd`."""

import sys

from rtcfd.main import main

sys.exit(main())

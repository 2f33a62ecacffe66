"""Run the service by `python3 -m rtcf_scope`."""

import sys

from rtcf_scope.service import main

sys.exit(main())

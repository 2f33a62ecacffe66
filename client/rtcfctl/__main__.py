"""Runs rtcfctl as `python3 -m rtcfctl`."""

import sys

from rtcfctl.main import main

sys.exit(main())

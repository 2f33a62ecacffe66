"""rtcfctl: the command line of rtcf.  One module per noun; no logic beyond calls."""

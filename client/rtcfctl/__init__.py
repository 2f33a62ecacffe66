"""rtcfctl, the command line of rtcf: a module per noun, a room per subject."""

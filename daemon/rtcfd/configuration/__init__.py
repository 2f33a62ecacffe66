"""The command line and the settings file, and what they make of rtcfd."""

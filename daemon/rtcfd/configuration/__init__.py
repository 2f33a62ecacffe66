"""The command line and the settings file of rtcfd."""

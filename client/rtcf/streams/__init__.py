"""Streams from rtcfd: values of every cycle, events, log records."""

"""Verbs for the values and events of a loop: echo, plot, record, trace, incidents, logs."""

"""Verbs about what happens in a loop: values of every cycle, recordings, incidents, events."""

"""Incident files: the last cycles before a fault or a crash."""

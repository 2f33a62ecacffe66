"""Recordings of every cycle: writing from streams, and reading."""

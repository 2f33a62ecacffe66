"""Recordings of every cycle: written from a stream, and read again."""

"""A component as it is written: its source, what it may not contain, how a mistake is told."""

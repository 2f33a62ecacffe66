"""Verbs about a runner and its loop: whether it runs, how fast, and what it cost."""

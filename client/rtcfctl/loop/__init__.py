"""Verbs for runners and their loops: state, settings, statistics."""

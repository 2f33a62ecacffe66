"""Compile components written in Python to ordinary component libraries."""

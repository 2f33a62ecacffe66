"""Compiles components written in Python into ordinary libraries of components."""

"""Compiled code beside the interpreter: the same inputs for both."""

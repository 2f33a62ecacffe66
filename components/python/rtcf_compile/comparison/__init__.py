"""Compares compiled code with the interpreter on the same inputs."""

"""Lets NumPy compute the same values on every processor: import this before NumPy."""

from rtcf_compile import instructions

instructions.choose()

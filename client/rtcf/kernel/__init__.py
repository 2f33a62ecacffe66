"""The kernel's trace of the CPU of a loop, and what made a cycle late by it."""

"""Verbs about the machine and the code on it: doctor, check."""

"""Verbs about what a loop consists of: components, wires, parameters, state, graph files."""

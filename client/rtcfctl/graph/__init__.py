"""Verbs for the graph: components, connections, parameters, state, graph files."""

"""The source of a component: its syntax trees, the checks of the source, error messages."""

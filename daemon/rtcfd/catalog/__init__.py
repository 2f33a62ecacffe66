"""Which component types there are, and in which library."""

"""The catalog of component types and their libraries."""

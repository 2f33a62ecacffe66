"""Rewrites functions of a component so that numba can compile them."""

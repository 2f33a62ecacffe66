"""What all rooms stand on: refusals and their codes, names, limits, budgets, settings."""

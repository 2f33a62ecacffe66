"""The base of all packages: errors and their codes, names, limits, budgets, settings."""

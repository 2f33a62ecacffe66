"""Output formats: tables, JSON and YAML, dates, sizes, and numbers with units."""

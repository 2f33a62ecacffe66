"""How answers are written: tables, JSON and YAML, dates, sizes, and words with units."""

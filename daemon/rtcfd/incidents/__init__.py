"""What ran just before a fault or a death, kept as files."""

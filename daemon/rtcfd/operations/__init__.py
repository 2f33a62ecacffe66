"""What is done to one runner, one thing at a time."""

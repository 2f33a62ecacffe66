"""What a client follows as it happens: values of every cycle, events."""

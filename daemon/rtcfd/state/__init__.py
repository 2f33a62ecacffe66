"""What was accepted and outlives a process: desired states, on disk and handed over."""

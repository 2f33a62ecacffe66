"""One executor process: its start and end, its socket, what it says unasked."""

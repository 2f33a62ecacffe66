"""One executor process: its start and end, its socket, its notifications."""

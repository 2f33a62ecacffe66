"""From functions to an object file, and the gate that it has to pass."""

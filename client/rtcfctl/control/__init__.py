"""Commands that identify a plant and tune its controller."""

"""The kernel's trace of a loop's CPU, and the causes of late cycles."""

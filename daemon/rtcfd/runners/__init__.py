"""The runners, and the leases on them and their components."""

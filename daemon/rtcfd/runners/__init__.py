"""The runners, and who holds them and their components."""

"""The control socket, the identity of its clients, and their rights."""

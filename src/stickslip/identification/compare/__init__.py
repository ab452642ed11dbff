"""Two identified models compared: what has changed, and by how much."""

"""A whole axis from any record: inertia, gravity or offset, and friction jointly."""

"""The sliding curve from constant-velocity records."""

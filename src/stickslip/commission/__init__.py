"""From an unknown machine to a model: every procedure in turn, identified by the package's own methods."""

"""Plain least squares on the rows of a record: inverse dynamics, and the force error of a model."""

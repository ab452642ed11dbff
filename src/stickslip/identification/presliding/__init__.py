"""A contact before and during break-away: stiffness, hysteresis, break-away, attraction."""

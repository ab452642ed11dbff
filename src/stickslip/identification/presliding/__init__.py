"""What a contact does before and as it breaks away: stiffness, hysteresis, break-away, attraction."""

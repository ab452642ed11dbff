"""The exact integrator: event-driven flow of a loop that is linear between events."""

"""The fixed-step integrator: an implicit step for any law."""

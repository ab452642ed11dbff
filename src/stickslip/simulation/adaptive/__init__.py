"""The adaptive integrator: Dormand-Prince 5(4) with located events."""

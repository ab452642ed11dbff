"""What moves the axis: linear controllers, compensators, filters."""

"""The frequency response of an axis: inertia, and the drivetrain's modes."""

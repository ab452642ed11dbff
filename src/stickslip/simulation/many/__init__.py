"""Many closed loops that differ in numbers: one after the other in compiled code, or side by side in vectors."""

"""Many closed loops that differ in numbers: in compiled code, over threads."""

"""What is moved: the machines."""

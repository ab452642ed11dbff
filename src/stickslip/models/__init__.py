"""Friction models with their values, references, and the laws and references that are found by name."""

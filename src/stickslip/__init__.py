"""stickslip finds the friction of a servo axis from its records, simulates it and compensates it."""

__version__ = "0.1.0"

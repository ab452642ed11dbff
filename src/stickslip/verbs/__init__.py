"""What the verbs of `stickslip` do, as functions: read, doctor, identify, compare, recommend, export, sweep, tune.

``import stickslip as ss`` has them all. The command line reads its options, calls these, and prints what they return.
"""

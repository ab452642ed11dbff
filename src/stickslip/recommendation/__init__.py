"""Recommend a compensator setting that is safe to switch on, from an identified model."""

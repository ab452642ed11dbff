"""Friction under prescribed motion."""

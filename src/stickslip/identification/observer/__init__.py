"""Prediction error: an observer holds a simulated axis to the measured motion."""

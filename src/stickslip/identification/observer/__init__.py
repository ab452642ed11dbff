"""Prediction error: an observer makes a simulated axis follow the measured motion."""

"""Identification of a servo axis by one estimator: windowed regression in gross sliding, averaged over alternatives."""

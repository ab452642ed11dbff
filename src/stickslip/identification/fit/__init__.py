"""Least squares, noise, intervals, filters: the mathematics that the methods share."""

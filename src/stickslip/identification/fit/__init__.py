"""Mathematics that the methods share: least squares, noise, intervals, filters."""

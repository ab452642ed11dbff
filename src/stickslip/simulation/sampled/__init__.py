"""The sampled engine: an axis between two samples of its controller, under a torque that is held."""

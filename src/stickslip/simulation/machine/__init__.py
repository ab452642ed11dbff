"""A virtual machine with its imperfections, sample by sample."""

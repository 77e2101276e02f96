"""Kernels of weak forms at a point: a function of the point, and loops of the cell around it."""

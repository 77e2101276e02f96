"""Kernels whose mathematics stands at a point: a function of the point, and loops of the cell."""

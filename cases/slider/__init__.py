"""A rigid profile over a moving plane: the film of a given gap, under the kernels of the seal."""

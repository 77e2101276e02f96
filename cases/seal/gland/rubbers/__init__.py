"""Rubbers: a material and its kernels from a hardness, tests or parameters."""

"""Rubbers: from a hardness, tests or numbers to a material and its kernels."""

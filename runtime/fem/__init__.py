"""Finite elements: numbering, assembly, constraints and results, without physics."""

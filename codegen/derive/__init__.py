"""Differentiation: interfaces, invariants and chain rules, from a potential to a tangent."""

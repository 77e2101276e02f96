"""Discretisation: dofmap, element blocks, assembly, constraints, loads, mass; without physics."""

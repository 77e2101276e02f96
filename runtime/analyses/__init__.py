"""Analyses of a defined problem: load and time stepping, arc length, dynamics, modes, buckling."""

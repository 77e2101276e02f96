"""Discrete equations of a defined problem: unknowns, mass, contacts, stability, modes."""

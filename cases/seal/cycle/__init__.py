"""Strokes in time: the motion of the rod, and the film over time."""

"""Strokes in time: how the rod moves, and the film that follows it."""

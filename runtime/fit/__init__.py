"""Inputs of a study that make its results what was measured; functions for optimisers."""

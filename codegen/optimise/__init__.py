"""Rewrites of the graph that keep its values and lower its cost."""

"""Meshes: points, cells and boundaries, and values carried between them."""

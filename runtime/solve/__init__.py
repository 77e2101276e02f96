"""Solvers, independent of meshes: linear systems, Newton's method, continuation, eigenvalues."""

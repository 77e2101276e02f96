"""Solvers: linear systems, Newton's method, continuation; they know no mesh."""

"""Expression graph: operations, derivatives, values in arbitrary precision."""

"""The expression graph: what it may hold, and its values in many digits."""

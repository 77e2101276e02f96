"""The cross-section and its mesh: how it is laid out, and the parts of its boundary."""

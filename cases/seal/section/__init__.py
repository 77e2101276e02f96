"""The cross-section and its mesh: nodes, elements and the parts of its boundary."""

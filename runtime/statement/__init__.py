"""Statement of a study: pages on elements, supports, loads, values at the start."""

"""What a study has been told: pages on elements, supports, loads, values at the start."""

"""The coupled system: its fields, blocks, loads, scales and unknowns."""

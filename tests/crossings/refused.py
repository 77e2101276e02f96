"""Combinations that are refused: (relations, features by axis, message); no relations: all.

The first line that fits a combination counts.
"""

REFUSED: tuple[tuple[tuple[str, ...], dict[str, tuple[str, ...]], str], ...] = ()

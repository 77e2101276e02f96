"""Combinations that are refused: (relations, condition on the problem, message); no relations: all.

The first line that fits a combination counts.
"""

from __future__ import annotations

from collections.abc import Callable

from tests.crossings.features import ANALYSES, March, Problem


def _moves(at: Problem) -> bool:
    """Whether the analysis has inertia."""
    analysis = ANALYSES[at.analysis]
    return isinstance(analysis, March) and analysis.rho is not None


def _mixed(at: Problem) -> bool:
    """Whether the law has unknowns without mass."""
    return at.law in ("mixed", "condensed", "taylor-hood", "enhanced")


REFUSED: tuple[tuple[tuple[str, ...], Callable[[Problem], bool], str], ...] = (
    (("sensitivity",), lambda at: at.analysis != "solve" and _moves(at), "has no derivatives"),
    ((), lambda at: at.solver == "matrix-free" and at.law != "product", "no product by sum"),
)
"""What a user reads."""

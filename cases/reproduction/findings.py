"""Every statement of the paper as (place, words, measure), in its order."""

from collections.abc import Callable

from cases.reproduction.findings_film import FILM
from cases.reproduction.findings_mesh import MESH
from cases.reproduction.look import Finding, Look

__all__ = ["FINDINGS", "Finding", "Look"]

FINDINGS: tuple[tuple[str, str, Callable[[Look], Finding]], ...] = (*FILM, *MESH)

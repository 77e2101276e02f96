"""The element that everybody computes, its reference values, and what counts as right."""

from __future__ import annotations

import enum
import functools
from dataclasses import dataclass

import numpy as np

from softehl.runtime.arrays import Array
from tests.reference import oracles
from tests.reference.states import State, displacement, quad

TOLERANCE = 1e-12
MATERIAL = (3.04, 0.62, 500.0)
"""mu_1, mu_2, kappa of the paper [MPa]."""


class Case(enum.Enum):
    """Formulation and task; A is the residual, B the residual and the full 8x8 tangent."""

    Q4_A = "Q4 A"
    Q4_B = "Q4 B"
    FBAR_A = "F-bar A"
    FBAR_B = "F-bar B"

    @property
    def fbar(self) -> bool:
        """True for Fbar = (det F0/det F)^(1/3) F."""
        return self in (Case.FBAR_A, Case.FBAR_B)

    @property
    def tangent(self) -> bool:
        """True when the tangent is asked for too."""
        return self in (Case.Q4_B, Case.FBAR_B)

    @property
    def title(self) -> str:
        """Title for a reader."""
        return self.value


@dataclass(frozen=True)
class Elements:
    """Coordinates and displacements (n, 8) in mm, node-major (z, r); parameters (3,) in MPa."""

    coordinates: Array
    displacements: Array
    parameters: Array

    def __len__(self) -> int:
        return len(self.coordinates)


@dataclass(frozen=True)
class Result:
    """Residuals (n, 8) in N, tangents (n, 8, 8) in N/mm or None."""

    residual: Array
    tangent: Array | None


@functools.cache
def elements(count: int = 256, seed: int = 2009) -> Elements:
    """Distorted, finitely deformed quads (0.6 < J < 1.6) with the paper's material."""
    rng = np.random.default_rng(seed)
    X = np.array([quad(rng, 25.0, 0.1) for _ in range(count)])
    u = np.array([displacement(rng, x, 0.3, 0.1) for x in X])
    return Elements(X, u, np.array(MATERIAL))


@functools.cache
def reference(case: Case, count: int = 3) -> Result:
    """The first `count` elements to 50 digits and more (mpmath), rounded to double."""
    given = elements()
    residual, tangent = [], []
    for X, u in zip(given.coordinates[:count], given.displacements[:count], strict=True):
        family = "solid_fbar" if case.fbar else "solid_q4"
        state = State(family, "", tuple(X), tuple(u), tuple(given.parameters))
        residual.append([float(v) for v in oracles.residual(state)])
        if case.tangent:
            tangent.append([[float(v) for v in row] for row in oracles.tangent(state)])
    return Result(np.array(residual), np.array(tangent) if case.tangent else None)


def deviation(result: Result, expected: Result) -> float:
    """Largest difference of an entry over the element's largest entry; inf where not finite.

    Only the elements of `expected` are looked at.
    """
    worst = 0.0
    pairs = ((result.residual, expected.residual), (result.tangent, expected.tangent))
    for got, right in pairs:
        if right is None:
            continue
        if got is None or not np.isfinite(got[: len(right)]).all():
            return float("inf")
        axes = tuple(range(1, right.ndim))
        scale = np.abs(right).max(axis=axes)
        worst = max(worst, float((np.abs(got[: len(right)] - right).max(axis=axes) / scale).max()))
    return worst

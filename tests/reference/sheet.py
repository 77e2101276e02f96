"""Incompressible sheet at principal logarithmic strains (e_1, e_2), its energy per unit volume."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from tests.reference.differentiate import Matrix, Number, Vector, gradient, hessian, mp, mpf

Law = Callable[..., Number]


def energy(e: Sequence[Number], parameters: Sequence[Number], law: Law) -> Number:
    """The isochoric term of a diagonal deformation gradient without change of volume."""
    zero = mpf(0)
    F = [mp.exp(e[0]), zero, zero, mp.exp(e[1]), mp.exp(-e[0] - e[1])]
    return law(F, *parameters)


def residual(e: Sequence[Number], parameters: Sequence[Number], law: Law) -> Vector:
    """sigma_1 - sigma_3 and sigma_2 - sigma_3."""
    return gradient(lambda v: energy(v, parameters, law), list(e))


def tangent(e: Sequence[Number], parameters: Sequence[Number], law: Law) -> Matrix:
    """Second differences of the energy."""
    return hessian(lambda v: energy(v, parameters, law), list(e))

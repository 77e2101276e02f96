"""Incompressible sheet at principal logarithmic strains (e_1, e_2), its energy per unit volume."""

from __future__ import annotations

from collections.abc import Callable

from tests.reference.differentiate import Arguments, Number, Vector, mp, mpf


def energy(a: Arguments, e: Vector, law: Callable[..., Number]) -> Number:
    """The isochoric term of a diagonal deformation gradient without change of volume.

    Its slopes are sigma_1 - sigma_3 and sigma_2 - sigma_3.
    """
    zero = mpf(0)
    F = [mp.exp(e[0]), zero, zero, mp.exp(e[1]), mp.exp(-e[0] - e[1])]
    return law(F, *a.parameters)

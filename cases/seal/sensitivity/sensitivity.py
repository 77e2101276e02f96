"""Exact sensitivities of a film: what a change of any parameter by one per cent does, in per cent.

All derivatives are those of the discrete equations at the converged state, d log q / d log s, with
the mesh frozen (`cases.seal.sensitivity.variation`). The film does not depend on the contact it
began from.
"""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType

import numpy as np

from softehl.cases.seal.gland.records.numerics import Numerics
from softehl.cases.seal.sensitivity.quantities import along, by_unknowns, fields_along, quantities
from softehl.cases.seal.sensitivity.variation import SPEED, FilmCase
from softehl.cases.seal.solve.films import Film
from softehl.cases.seal.solve.method import Differentiate
from softehl.runtime.arrays import Array
from softehl.runtime.fem.design import Inputs, Tangent
from softehl.runtime.solve.backends import choose
from softehl.runtime.solve.linear import LinearSolver, SingularMatrix
from softehl.runtime.solve.sensitivity import adjoints


def rates_of(
    case: FilmCase, known: Mapping[str, Inputs] = MappingProxyType({})
) -> dict[str, Inputs]:
    """Parameter -> rate of the inputs of a film by its logarithm.

    known: the rates of another film of the system; of these only that of the speed is another.
    """
    kept = {name: rate for name, rate in known.items() if name != SPEED}
    return {name: kept.get(name) or case.rate(name) for name in case.parameters}


def sensitivities(
    case: FilmCase, x: Array, linear: LinearSolver, rates: Mapping[str, Inputs]
) -> dict[str, dict[str, float]]:
    """Quantity -> parameter -> d log quantity / d log parameter at a converged film x (n,).

    rates: of the parameters, by `rates_of` at this film. Raises SingularMatrix.
    """
    found, tangent = quantities(case, x), Tangent.at(case.problem, x)
    gradients = np.stack([by_unknowns(case, x, q) for q in found.values()], axis=1)
    loads = np.stack([tangent.load(rate) for rate in rates.values()], axis=1)
    through = -adjoints(linear, tangent.reduced, gradients).T @ loads
    slopes: dict[str, dict[str, float]] = {name: {} for name in found}
    for j, (key, rate) in enumerate(rates.items()):
        moved = fields_along(case, x, rate, found.values())
        for i, (name, q) in enumerate(found.items()):
            slopes[name][key] = float(through[i, j]) + along(case, q, key, rate, moved)
    return slopes


def differentiation(p: Numerics) -> Differentiate | None:
    """Function that differentiates the films of a run; None where a case does not ask for it.

    Rates are kept for the films of the mesh that was last in use.
    """
    if not p.sensitivity:
        return None
    linear, known, last = choose(p.linear), dict[str, Inputs](), None

    def differentiate(film: Film) -> Mapping[str, Mapping[str, float]] | None:
        nonlocal known, last
        case = FilmCase(film.system, film.loads)
        known, last = rates_of(case, known if film.system is last else {}), film.system
        try:
            return sensitivities(case, film.x, linear, known)
        except SingularMatrix:
            return None

    return differentiate

"""Exact sensitivities of a film: what a change of any parameter by one per cent does, in per cent.

All derivatives are those of the discrete equations at the converged state, d log q / d log s. The
mesh moves with the section (`frozen_mesh_map`). For what a run reports it moves with the edges of
the film, too (`moving_mesh`). The film does not depend on the contact it began from.

With K = dR/dx and the load b = dR/ds of a variation, dx = -K^-1 b, and a quantity q(x, s) has
dq/ds = q_s + q_x . dx = q_s - l . b with K^T l = q_x: one solve of the adjoint for each quantity.
"""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType

import numpy as np
from scipy.sparse import csc_array

from softehl.cases.seal.gland.records import Numerics
from softehl.cases.seal.sensitivity.frozen_mesh_map import SPEED, FilmCase
from softehl.cases.seal.sensitivity.moving_mesh import edges, shift_rate, velocities
from softehl.cases.seal.sensitivity.pseudo_loads import Inputs, Tangent
from softehl.cases.seal.sensitivity.quantities import (
    SealQuantity,
    along,
    by_unknowns,
    fields_along,
    quantities,
)
from softehl.cases.seal.solve.driver import Differentiate
from softehl.cases.seal.solve.film_solver import Film
from softehl.runtime.arrays import Array
from softehl.runtime.solve.linear.direct import direct_solver
from softehl.runtime.solve.linear.linear_solver import LinearSolver, SingularMatrix, SparseMatrix


def adjoints(linear: LinearSolver, K: SparseMatrix, gradients: Array) -> Array:
    """Adjoints l (n, k) of quantities with the gradients q_x (n, k); raises SingularMatrix."""
    factors = linear.factorise(csc_array(K.T))
    return np.stack([factors.solve(g) for g in gradients.T], axis=1)


def rates_of(
    case: FilmCase, existing: Mapping[str, Inputs] = MappingProxyType({})
) -> dict[str, Inputs]:
    """Parameter -> rate of the inputs of a film by its logarithm.

    existing: the rates of another film of the system; of these only that of the speed is another.
    """
    reused = {name: rate for name, rate in existing.items() if name != SPEED}
    return {name: reused.get(name) or case.rate(name) for name in case.parameters}


Slopes = dict[str, dict[str, float]]
"""Quantity -> parameter -> d log quantity / d log parameter."""


def sensitivities(
    case: FilmCase, x: Array, linear: LinearSolver, rates: Mapping[str, Inputs]
) -> Slopes:
    """The sensitivities of a converged film x (n,), on a mesh that follows its edges.

    rates: of the parameters, by `rates_of` at this film. Raises SingularMatrix.
    """
    values = quantities(case, x)
    moving = {f"edge {k}": e for k, e in enumerate(edges(case, x, values["h_star"].value))}
    nodes = zip(moving, velocities(case, list(moving.values())), strict=True)
    shifts = {name: shift_rate(case, velocity) for name, velocity in nodes}
    of = {**values, **{name: edge.moved for name, edge in moving.items()}}
    log_derivatives = frozen_slopes(case, x, linear, {**rates, **shifts}, of)
    for_parameters = {q: {key: log_derivatives[q][key] for key in rates} for q in log_derivatives}
    edge_velocities = {
        name: edge.velocities(for_parameters[name], for_parameters["h_star"])
        for name, edge in moving.items()
    }
    return {
        q: {
            key: slope
            + sum(edge_velocities[name][key] * log_derivatives[q][name] for name in moving)
            for key, slope in for_parameters[q].items()
        }
        for q in values
    }


def frozen_slopes(
    case: FilmCase,
    x: Array,
    linear: LinearSolver,
    rates: Mapping[str, Inputs],
    of: Mapping[str, SealQuantity],
) -> Slopes:
    """Derivatives of these quantities of a film x (n,) on a mesh that moves with the section alone.

    Raises SingularMatrix.
    """
    tangent = Tangent.at(case.problem, x)
    gradients = np.stack([by_unknowns(case, x, q) for q in of.values()], axis=1)
    loads = np.stack([tangent.load(rate) for rate in rates.values()], axis=1)
    through = -adjoints(linear, tangent.reduced, gradients).T @ loads
    log_derivatives: Slopes = {name: {} for name in of}
    for j, (key, rate) in enumerate(rates.items()):
        moved = fields_along(case, x, rate, of.values())
        for i, (name, q) in enumerate(of.items()):
            log_derivatives[name][key] = float(through[i, j]) + along(case, q, key, rate, moved)
    return log_derivatives


def differentiation(p: Numerics) -> Differentiate | None:
    """Function that differentiates the films of a run; None where a case does not ask for it.

    Rates are kept for the films of the mesh that was last in use.
    """
    if not p.sensitivity:
        return None
    linear, existing, last = direct_solver(p.linear), dict[str, Inputs](), None

    def differentiate(film: Film) -> Mapping[str, Mapping[str, float]] | None:
        nonlocal existing, last
        case = FilmCase(film.system, film.loads)
        existing, last = rates_of(case, existing if film.system is last else {}), film.system
        try:
            return sensitivities(case, film.x, linear, existing)
        except SingularMatrix:
            return None

    return differentiate

"""Quantities of a result that are differentiated, with their slopes by the unknowns."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any, Protocol, TypeAlias

import numpy as np

from softehl.runtime.arrays import Array, Integers
from softehl.runtime.definition.problem_definition import RigidBody, StudyError
from softehl.runtime.definition.rigid_bodies import component_of
from softehl.runtime.equations.interpolation import interpolation_weights
from softehl.runtime.equations.system import System
from softehl.runtime.mesh.checks import place_text
from softehl.runtime.mesh.mesh import Mesh, MeshError
from softehl.runtime.sensitivity.linearised_step import LinearisedStep
from softehl.runtime.sensitivity.tape import Tape
from softehl.runtime.suggestions import did_you_mean, join_names

UserFunction: TypeAlias = Callable[[Array], tuple[float, Array] | tuple[float, Array, Any]]
_WITH_HESSIAN = 3  # values of a function of the unknowns: with gradient and Hessian


class Quantity(Protocol):
    """A number that a converged step has."""

    def value(self, tape: Tape) -> float:
        """The number."""
        ...

    def slope(self, step: LinearisedStep) -> Array:
        """Its derivative by all unknowns, (n,)."""
        ...

    def weights(self, step: LinearisedStep) -> Array:
        """Weights (n,) with which it counts the forces that make reactions, zero if it does not."""
        ...

    def curvature(self, step: LinearisedStep, dx: Array) -> Array:
        """Rate (n,) of its derivative by the unknowns along dx (n,); forces apart."""
        ...


@dataclass(frozen=True, eq=False)
class _Located:
    """A place on a mesh with the numbers (points,) of an unknown: which of them make its value."""

    mesh: Mesh
    numbers: Integers
    dofs: Integers
    weights: Array


@dataclass(frozen=True)
class PointValue:
    """An unknown at a place of the undeformed mesh, or of the motion of a rigid body."""

    name: str
    point: tuple[float, ...]
    _last: list[_Located] = field(default_factory=list, repr=False, compare=False)

    def value(self, tape: Tape) -> float:
        """See `Quantity`."""
        return float(self._weights(tape.system) @ tape.x)

    def slope(self, step: LinearisedStep) -> Array:
        """See `Quantity`."""
        return self._weights(step.tape.system)

    def _weights(self, system: System) -> Array:
        """Weights (n,) of all unknowns; a fit asks for them at every step of every trial."""
        _require(self.name, system)
        weights_of_all, numbers = np.zeros(system.size), system.numbering.nodal[self.name]
        last = self._last[0] if self._last else None
        if (
            last is None
            or last.mesh is not system.mesh
            or not np.array_equal(last.numbers, numbers)
        ):
            last = _Located(system.mesh, numbers, *self._located(system))
            self._last[:] = [last]
        np.add.at(weights_of_all, last.dofs, last.weights)
        return weights_of_all

    def _located(self, system: System) -> tuple[Integers, Array]:
        """Numbers and weights (k,) of the unknowns that make the value."""
        for body in _bodies(system).values():
            if self.name in [body.unknown(c) for c in body.components]:
                return system.numbering.nodal[self.name][[body.node]], np.ones(1)
        point = np.asarray(self.point, dtype=np.float64)
        by_unknown = interpolation_weights(system, point)
        if by_unknown is None:
            raise MeshError(f"{place_text(point)} lies outside the mesh")
        if self.name not in by_unknown:
            raise StudyError(
                f"no {self.name} at {place_text(point)}; there are {join_names(by_unknown)}"
            )
        return by_unknown[self.name]

    def weights(self, step: LinearisedStep) -> Array:
        """See `Quantity`."""
        return np.zeros(step.tape.system.size)

    def curvature(self, step: LinearisedStep, dx: Array) -> Array:
        """See `Quantity`."""
        return np.zeros_like(dx)


@dataclass(frozen=True)
class ReactionSum:
    """The sum of reactions at a side."""

    name: str
    side: str

    def value(self, tape: Tape) -> float:
        """See `Quantity`."""
        step = LinearisedStep(tape)
        return float(self.weights(step) @ step.forces())

    def slope(self, step: LinearisedStep) -> Array:
        """See `Quantity`."""
        return step.by_unknowns(self.weights(step))

    def weights(self, step: LinearisedStep) -> Array:
        """See `Quantity`."""
        system = step.tape.system
        bodies = _bodies(system)
        if self.side in bodies:
            return _force_on(bodies[self.side], self.name, system)
        _require(self.name, system)
        dofs, weights = system.numbering.nodal[self.name], np.zeros(system.size)
        side_dofs = dofs[system.mesh.nodes(self.side)]
        weights[side_dofs[side_dofs >= 0]] = 1.0
        return weights

    def curvature(self, step: LinearisedStep, dx: Array) -> Array:
        """See `Quantity`."""
        return np.zeros_like(dx)


def _bodies(system: System) -> Mapping[str, RigidBody]:
    return {} if system.definition is None else system.definition.rigids


def _force_on(body: RigidBody, component: str, system: System) -> Array:
    """Weights (n,) of a component of the reaction of a rigid body."""
    name = component_of(body, f"reaction={body.name!r}", component)
    if component.startswith("theta_") and body.finite:
        raise StudyError(
            f"reaction={body.name!r}: {component}: a moment in space depends on the rotation, and "
            'has no derivatives here: forces have, and with rotations="small" moments'
        )
    weights = np.zeros(system.size)
    weights[system.numbering.nodal[name][body.node]] = 1.0
    return weights


@dataclass(frozen=True)
class UserQuantity:
    """A function of all unknowns (n,) that returns its value and its gradient (n,), and for second
    derivatives its Hessian (n, n).
    """

    function: UserFunction

    def value(self, tape: Tape) -> float:
        """See `Quantity`."""
        return float(self.function(tape.x)[0])

    def slope(self, step: LinearisedStep) -> Array:
        """See `Quantity`."""
        gradient = np.asarray(self.function(step.tape.x)[1], dtype=np.float64)
        if gradient.shape != step.tape.x.shape:
            raise StudyError(
                f"the gradient of a quantity has the shape {gradient.shape}, must be "
                f"{step.tape.x.shape}"
            )
        return gradient

    def weights(self, step: LinearisedStep) -> Array:
        """See `Quantity`."""
        return np.zeros(len(step.tape.x))

    def curvature(self, step: LinearisedStep, dx: Array) -> Array:
        """See `Quantity`."""
        values: Any = self.function(step.tape.x)
        if len(values) != _WITH_HESSIAN:
            raise StudyError(
                "second derivatives of a function of the unknowns need its own: let it return "
                "(value, gradient (n,), Hessian (n, n)), an array, a sparse matrix or a "
                "LinearOperator"
            )
        hessian = values[2]
        if np.shape(hessian) != (len(dx), len(dx)):
            raise StudyError(
                f"the Hessian of a quantity has the shape {np.shape(hessian)}, must be "
                f"{(len(dx), len(dx))}"
            )
        return np.asarray(hessian @ dx)


def quantity(
    what: str | UserFunction,
    at: tuple[float, ...] | str | None,
    reaction: str | None,
) -> Quantity:
    """Return the quantity of a request; at: a place or a rigid body.  Raises StudyError."""
    if callable(what):
        return UserQuantity(what)
    if (at is None) == (reaction is None):
        raise StudyError(
            f"quantity {what!r}: give at=(x, y), a place, or reaction=..., a side: one of them"
        )
    if isinstance(at, str):
        return PointValue(f"{at}:{what}", ())
    return ReactionSum(what, reaction) if at is None and reaction is not None else _at(what, at)


def _at(name: str, at: tuple[float, ...] | None) -> PointValue:
    try:
        return PointValue(name, tuple(float(c) for c in at or ()))
    except (TypeError, ValueError):
        raise StudyError(f"at={at!r}: a place is a tuple of numbers, (48, 60)") from None


def _require(name: str, system: System) -> None:
    nodal = system.numbering.nodal
    if name not in nodal:
        body, _, motion = name.rpartition(":")
        if body:
            raise StudyError(
                f"at={body!r}: no rigid body has {motion!r}; a place is a tuple of numbers, "
                "(48, 60)"
            )
        raise StudyError(
            f"no unknown {name!r}{did_you_mean(name, nodal)}; at nodes: {join_names(nodal)}"
        )

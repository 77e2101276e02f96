"""A study as one operation of JAX: its unknowns as a function of its inputs."""

from __future__ import annotations

import importlib
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from softehl.runtime.arrays import Array, Integers
from softehl.runtime.definition.problem_definition import StudyError
from softehl.runtime.fit.objective import StudyEvaluations
from softehl.runtime.sensitivity.jacobian import jacobian
from softehl.runtime.sensitivity.quantities import UserQuantity

SECOND = (
    "the adjoint of a study has no derivatives, so its solution has no second ones: take jax.grad "
    "or jax.vjp once"
)


@dataclass(eq=False)
class Operation:
    """All unknowns (n,) as a function of inputs (k,); `jax.grad`, `jit` and `vmap` apply to it.

    The derivative in reverse mode is one adjoint solution, for any k. Forward mode and second
    derivatives are refused.

    Attributes
    ----------
    trials : object
        The study, solved for values of inputs.
    """

    trials: StudyEvaluations

    @property
    def start(self) -> Array:
        """Inputs as the study has them, (k,)."""
        return self.trials.start

    def places(self, name: str) -> Integers:
        """Return the numbers of an unknown among all unknowns.

        Parameters
        ----------
        name : str
            Name of an unknown at nodes.

        Returns
        -------
        array of int (points,)
            -1 at nodes without it.

        Raises
        ------
        StudyError
            There is no such unknown at nodes.
        """
        nodal = self._first.system.numbering.nodal
        if name not in nodal:
            raise StudyError(f"no unknown {name!r} at nodes; there are {', '.join(nodal)}")
        numbers: Integers = nodal[name]
        return numbers

    def __call__(self, values: Any) -> Any:
        """Return all unknowns; JAX reports a solution that is not found.

        Parameters
        ----------
        values : array (k,)
            Values of the inputs.

        Returns
        -------
        array (n,)
            The unknowns.
        """
        return self._traced(values)

    @cached_property
    def _first(self) -> Any:
        return self.trials.solved(self.start)[-1]

    @cached_property
    def _traced(self) -> Callable[[Any], Any]:
        jax, jnp = _jax()
        unknowns = jax.ShapeDtypeStruct(self._first.x.shape, jnp.float64)
        inputs = jax.ShapeDtypeStruct(self.start.shape, jnp.float64)

        def adjoint(values: Any, g: Any) -> Any:
            return jax.pure_callback(self._adjoint, inputs, values, g, vmap_method="sequential")

        def refused(primals: Any, tangents: Any) -> Any:
            raise NotImplementedError(SECOND)

        def solve(values: Any) -> Any:
            values = jnp.asarray(values, dtype=jnp.float64)
            if values.shape != inputs.shape:
                raise TypeError(f"inputs have shape {values.shape}, must be {inputs.shape}")
            return jax.pure_callback(self._solved, unknowns, values, vmap_method="sequential")

        pull: Any = jax.custom_jvp(adjoint)
        pull.defjvp(refused)
        solved: Any = jax.custom_vjp(solve)
        solved.defvjp(lambda values: (solved(values), values), lambda p, g: (pull(p, g),))
        traced: Callable[[Any], Any] = solved
        return traced

    def _solved(self, values: Any) -> Array:
        return self.trials.solved(np.asarray(values))[-1].x

    def _adjoint(self, values: Any, g: Any) -> Array:
        tape = self.trials.solved(np.asarray(values))[-1].trail
        assert tape is not None
        weights = np.asarray(g)
        along = UserQuantity(lambda x: (float(weights @ x), weights))
        row: Array = jacobian([(tape, along)], self.trials.inputs)[0]
        return row


def _jax() -> tuple[Any, Any]:
    try:
        jax: Any = importlib.import_module("jax")
    except ImportError:
        raise StudyError("JAX is not installed: pip install jax") from None
    if not jax.config.jax_enable_x64:
        raise StudyError('a study computes in float64: jax.config.update("jax_enable_x64", True)')
    return jax, importlib.import_module("jax.numpy")

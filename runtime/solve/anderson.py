"""Mixing of the iterates of a fixed-point iteration, after Anderson (1965)."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from softehl.runtime.arrays import Array
from softehl.runtime.solve.condensed import Iterate, LayeredProblem


@dataclass
class AndersonMixing:
    """The latest iterates of one solve, at most depth + 1: `add` and `clear` change them."""

    problem: LayeredProblem
    depth: int
    iterates: list[Iterate] = field(default_factory=list)

    @property
    def latest(self) -> Iterate:
        return self.iterates[-1]

    def add(self, x: Array, r: Array) -> None:
        """Add x with its residual r, both (n,)."""
        problem, body = self.problem, r.copy()
        body[problem.shared] -= problem.layer_residual(x)[: len(problem.shared)]
        body[problem.own] = 0.0
        self.iterates.append(Iterate(x, r, body))
        del self.iterates[: -self.depth - 1]

    def clear(self) -> None:
        self.iterates.clear()

    def mixed(self) -> Iterate:
        """The combination of the iterates with the smallest residual, were it linear in x."""
        now, others = self.latest, self.iterates[:-1]
        if not others:
            return now
        scaled = self.problem.scaled(now.r)
        changes = np.stack([self.problem.scaled(o.r) - scaled for o in others], axis=1)
        weights = np.linalg.lstsq(changes, -scaled, rcond=1e-10)[0]
        x, r, body = now.x, now.r, now.body
        for weight, other in zip(weights, others, strict=True):
            x = x + weight * (other.x - now.x)
            r = r + weight * (other.r - now.r)
            body = body + weight * (other.body - now.body)
        return Iterate(x, r, body) if self.problem.layer_limit(now.x, x - now.x) == 1.0 else now

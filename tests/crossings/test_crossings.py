"""Features that are right alone are right together: metamorphic tests over the tables.

Every combination is right to its tolerance, or refused by a message that `REFUSED` names.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import product

import numpy as np
import pytest

from tests.crossings.features import AXES, Problem
from tests.crossings.refused import REFUSED
from tests.crossings.relations import RELATIONS, Relation

SLOW = ("explicit", "axisymmetric")
"""Features that the quick tests leave out, beside all kinds of cells but the first."""

EXPLICIT = ("static state", "equilibrium", "contact")
"""Relations that explicit marches are tried on; they take seconds."""


@dataclass(frozen=True)
class Crossing:
    """A relation at a problem; quick: at most one feature differs from the base."""

    name: str
    problem: Problem
    quick: bool

    @property
    def relation(self) -> Relation:
        """By its name."""
        return RELATIONS[self.name]

    @property
    def features(self) -> dict[str, str]:
        """Axis -> feature."""
        return {axis: getattr(self.problem, axis) for axis in AXES}

    def __str__(self) -> str:
        """Relation, and the features that differ from the base."""
        base = self.relation.base
        other = [f for axis, f in self.features.items() if f != getattr(base, axis)]
        return ", ".join([self.name, *other])


def crossings() -> Iterator[Crossing]:
    """All combinations of the tables."""
    for name, relation in RELATIONS.items():
        base = relation.base
        known = set()
        singles = [{axis: f} for axis in relation.over for f in AXES[axis]]
        doubles = [{a: f, b: g} for a, b in relation.pairs for f, g in product(AXES[a], AXES[b])]
        for features in singles + doubles:
            problem = replace(base, **features)  # type: ignore[arg-type]
            if problem in known or not relation.of(problem) or _long(name, problem):
                continue
            known.add(problem)
            other = {a: f for a, f in features.items() if f != getattr(base, a)}
            quick = len(other) < 2 and not set(other.values()) & set(SLOW)
            yield Crossing(name, problem, quick and set(other) <= set(relation.quick))


def _long(relation: str, at: Problem) -> bool:
    """Whether a march takes too many stable steps for what it would show."""
    if at.analysis != "explicit":
        return False
    return relation not in EXPLICIT or at.cell != AXES["cell"][0] or at.law == "unit cells"


def refusal(crossing: Crossing) -> str | None:
    """Message with which a combination is refused."""
    for relations, condition, message in REFUSED:
        if (not relations or crossing.name in relations) and condition(crossing.problem):
            return message
    return None


def check(crossing: Crossing) -> None:
    """Compare both routes, or the message."""
    relation, message = crossing.relation, refusal(crossing)
    if message is not None:
        with pytest.raises((ValueError, RuntimeError, Warning), match=message):
            list(relation.routes(crossing.problem))
        return
    looser = [relation.looser.get(f, 0.0) for f in crossing.features.values()]
    tolerance = max(relation.tolerance, *looser)
    for one, other in relation.routes(crossing.problem):
        size = max(float(np.abs(other).max()), 1e-12 if np.size(other) > 1 else 0.0) or 1.0
        off = float(np.abs(np.asarray(one) - np.asarray(other)).max()) / size
        assert off <= tolerance, f"{crossing}: off by {off:.1e}, allowed {tolerance:.1e}"


def _marked(crossing: Crossing) -> object:
    marks = () if crossing.quick else (pytest.mark.slow,)
    return pytest.param(crossing, id=re.sub(r"\W+", "-", str(crossing)), marks=marks)


@pytest.mark.parametrize("crossing", [_marked(c) for c in crossings()])
def test_two_routes_agree_or_are_refused(crossing: Crossing) -> None:
    """See the module."""
    check(crossing)

"""Features that are right alone are right together: metamorphic tests over the tables.

Every combination is right to its tolerance, or refused by a message that `REFUSED` names. Pairs of
features are tried layer by layer (`ALIKE`); `SOFTEHL_CROSSINGS=all` tries the whole product.
"""

from __future__ import annotations

import os
import re
from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import product

import numpy as np
import pytest

from tests.crossings.features import ALIKE, AXES, Problem
from tests.crossings.refused import REFUSED, Row
from tests.crossings.relations import RELATIONS, Relation

SLOW = ("explicit", "axisymmetric")
"""Features that the quick tests leave out, beside all kinds of cells but the first."""

EXPLICIT = ("static state", "equilibrium", "contact")
"""Relations that explicit marches are tried on; they take seconds."""

WHOLE = {
    "law": ("static state", "one body", "sensitivity", "hessian", "periodic cell", "turned"),
    "cell": ("static state", "turned", "frequencies", "refinement", "periodic cell", "files"),
}
"""Relations that try all laws and all cells; the others, one of each layer."""

FAMILIES = (
    ("units", "renumbered", "groups"),
    ("contact", "law of contact", "rigid surface"),
)
"""Relations with one way through the program: they share pairs of layers, each takes some."""

FAILED = (
    {"product", "matrix-free"},
    {"mixed", "generalised-alpha"},  # the start of motions with pressures without mass
    {"mixed", "midpoint"},
    {"softened", "start"},  # history of each term
    {"split", "mixed precision"},  # routines of a point in double
)
"""Pairs that were wrong once, or that have a way of their own beside that of their layers."""


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

    @property
    def other(self) -> dict[str, str]:
        """Features that differ from the base, by axis."""
        base = self.relation.base
        return {axis: f for axis, f in self.features.items() if f != getattr(base, axis)}

    def __str__(self) -> str:
        """Relation, and the features that differ from the base."""
        return ", ".join([self.name, *self.other.values()])


def chosen() -> Iterator[Crossing]:
    """Combinations that are tried: quick ones, layers and pairs of layers, `WHOLE`, `FAILED`.

    Of every message of `REFUSED` that they do not meet, the first combination.
    """
    refused = set()
    for crossing in sorted(crossings(), key=lambda c: len(c.other)):
        message = refusal(crossing)
        new = message is not None and message not in refused
        if new or crossing.quick or _stands(crossing):
            yield crossing
            refused.add(message)


def _stands(crossing: Crossing) -> bool:
    """Whether a combination is tried for its layers, or for itself."""
    name, other = crossing.name, crossing.other
    if len(other) < 2 and any(name in WHOLE.get(axis, (name,)) for axis in other):
        return True
    if any(pair <= set(other.values()) for pair in FAILED):
        return True
    if not all(f in ALIKE[axis] for axis, f in other.items()):
        return False
    family = next((names for names in FAMILIES if name in names), (name,))
    turn = sum(list(ALIKE[axis]).index(f) for axis, f in other.items())
    return len(other) < 2 or name == family[turn % len(family)]


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
    return next((row[2] for row in REFUSED if meets(crossing, row)), None)


def meets(crossing: Crossing, row: Row) -> bool:
    """Whether a line of `REFUSED` holds for a combination."""
    relations, condition, _ = row
    return (not relations or crossing.name in relations) and condition(crossing.problem)


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


TRIED = tuple(crossings() if os.environ.get("SOFTEHL_CROSSINGS") == "all" else chosen())


# a coarse body on a coarse one overlaps with it in explicit steps, by both routes alike
@pytest.mark.filterwarnings("ignore::softehl.SoftContact")
@pytest.mark.parametrize("crossing", [_marked(c) for c in TRIED])
def test_two_routes_agree_or_are_refused(crossing: Crossing) -> None:
    """See the module."""
    check(crossing)


def test_every_feature_has_one_layer() -> None:
    for axis, layers in ALIKE.items():
        features = [f for first, others in layers.items() for f in (first, *others)]
        assert sorted(features) == sorted(AXES[axis])


def test_what_is_tried_meets_every_layer_and_every_refusal() -> None:
    tried, every = list(chosen()), list(crossings())
    assert {c for c in every if c.quick} == {c for c in tried if c.quick}
    assert set(map(refusal, every)) == set(map(refusal, tried))
    met = {frozenset(c.other.items()) for c in tried}
    layers = {
        frozenset(c.other.items())
        for c in every
        if all(f in ALIKE[axis] for axis, f in c.other.items())
    }
    assert layers <= met

"""Random models of branches in branches, and what they mean: mpmath on the tree that was drawn.

Every side may lack a value where another one is taken.  The meaning is evaluated on plain tuples,
side by side as the branches say, and differentiated by differences in 80 digits: nothing of SymPy
or of the generator is in it.
"""

from __future__ import annotations

import random
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import mpmath
import sympy as sp

from softehl.codegen.elements import quadrature
from softehl.codegen.language.definition import Definition
from softehl.codegen.language.model import Model

Tree = tuple[Any, ...]
LEAVES = ("T", "x", "g", "k")
KINDS = ["+", "-", "*", "pieces", "pieces", "pieces", "sqrt", "log", "1/", "3/2", "named", "max"]
DIGITS, STEP = 80, mpmath.mpf(10) ** -20
RULE = quadrature.gauss(2, 1)


class NoValueError(ArithmeticError):
    """A state without a value, or so near to a kink that the side cannot be told."""


def drawn(rng: random.Random, depth: int, leaves: Sequence[str] = LEAVES) -> Tree:
    """A tree of operations."""
    if depth == 0 or rng.random() < 0.1:
        if rng.random() < 0.3:
            return ("number", sp.Rational(rng.randint(-9, 9), rng.randint(2, 7)))
        return (rng.choice(leaves),)
    kind = rng.choice(KINDS)
    count = {"sqrt": 1, "log": 1, "1/": 1, "3/2": 1, "named": 1, "pieces": 4}.get(kind, 2)
    inside = [drawn(rng, depth - 1, leaves) for _ in range(count)]
    return (kind, *inside, *([rng.random() < 0.5] if kind == "pieces" else []))


def value(tree: Tree, at: Mapping[str, Any], less: Callable[[Any, Any], bool] | None = None) -> Any:
    """Real value of a tree; raises NoValueError.  less: decides a < b."""
    less = less or _less
    kind, *parts = tree
    if kind == "number":
        return mpmath.mpf(int(parts[0].p)) / int(parts[0].q)
    if kind in at:
        return at[kind]
    if kind == "pieces":
        a, b, then, otherwise, _strict = parts
        left, right = value(a, at, less), value(b, at, less)
        return value(then if less(left, right) else otherwise, at, less)
    args = [value(p, at, less) for p in parts]
    if kind == "max":
        return args[1] if less(*args) else args[0]
    if (kind in ("sqrt", "3/2", "log") and args[0] <= 0) or (kind == "1/" and args[0] == 0):
        raise NoValueError
    return {
        "+": lambda a, b: a + b,
        "-": lambda a, b: a - b,
        "*": lambda a, b: a * b,
        "sqrt": mpmath.sqrt,
        "log": mpmath.log,
        "1/": lambda a: 1 / a,
        "3/2": lambda a: a * mpmath.sqrt(a),
        "named": lambda a: a,
    }[kind](*args)


Derivatives = tuple[list[Any], list[list[Any]]]


def derivatives(f: Callable[[list[Any]], Any], at: Sequence[float]) -> Derivatives:
    """First and second derivatives of a function, without those by the last value first."""
    with mpmath.workdps(DIGITS):
        base, n = [mpmath.mpf(v) for v in at], len(at)

        def moved(*moves: tuple[int, int]) -> Any:
            place = list(base)
            for i, s in moves:
                place[i] += s * STEP
            return f(place)

        pairs = [(1, 1, 1), (-1, -1, 1), (1, -1, -1), (-1, 1, -1)]
        R = [(moved((i, 1)) - moved((i, -1))) / (2 * STEP) for i in range(n - 1)]
        K = [
            [sum(c * moved((i, a), (j, b)) for a, b, c in pairs) / (4 * STEP**2) for j in range(n)]
            for i in range(n - 1)
        ]
        return R, K


def _less(a: Any, b: Any) -> bool:
    if abs(a - b) < mpmath.mpf(10) ** -9:
        raise NoValueError
    return bool(a < b)


def written(m: Model, tree: Tree, known: Mapping[str, Any], names: dict[Tree, Any]) -> Any:
    """The tree in SymPy, on a page."""
    kind, *parts = tree
    if kind == "number":
        return parts[0]
    if kind in known:
        return known[kind]
    args = [written(m, p, known, names) for p in parts if isinstance(p, tuple)]
    match kind:
        case "pieces":
            condition = args[0] < args[1] if parts[-1] else args[0] <= args[1]
            return sp.Piecewise((args[2], condition), (args[3], True))
        case "named":
            if tree not in names:
                names[tree] = m.define(f"named_{len(names)}", args[0])
            return names[tree]
    return {
        "+": lambda a, b: a + b,
        "-": lambda a, b: a - b,
        "*": lambda a, b: a * b,
        "sqrt": sp.sqrt,
        "log": sp.log,
        "1/": lambda a: 1 / a,
        "3/2": lambda a: a ** sp.Rational(3, 2),
        "max": sp.Max,
    }[kind](*args)


@dataclass
class Nested:
    """An energy of one value of the element and one that is interpolated, with two points."""

    name: str
    energy: Tree

    def definition(self) -> Definition:
        """The model."""
        m = Model(self.name, nodes=2, rule=RULE)
        T = m.unknown("T")
        (x,) = m.nodal_unknowns("x")
        (k,) = m.parameters(k="number")
        (xi,) = m.point()
        field = m.define("field", (1 - xi) / 2 * x[0] + (1 + xi) / 2 * x[1])
        known = {"T": T, "x": field, "g": xi + T, "k": k}
        tree = written(m, self.energy, known, {})
        m.potential(m.integral("Pi", tree + (T**2 + field**2) / 2 + k * T))
        m.offer(product=True, pseudo_load=True, derivatives=[k])
        return m.finish()

    # the meaning ----------------------------------------------------------------------------------

    def total(self, dofs: Sequence[Any], k: Any) -> Any:
        """Energy in many digits."""
        T, first, second = dofs
        found = mpmath.mpf(0)
        for xi, sign in ((1 / mpmath.sqrt(3), 1), (1 / mpmath.sqrt(3), -1)):
            at = xi * sign
            x = (1 - at) / 2 * first + (1 + at) / 2 * second
            found += value(self.energy, {"T": T, "x": x, "g": at + T, "k": k})
            found += (T**2 + x**2) / 2 + k * T
        return found

    def tangent(self, dofs: Sequence[float], k: float) -> Derivatives:
        """Residual and its derivatives by the unknowns and, in the last column, by k."""
        return derivatives(lambda v: self.total(v[:-1], v[-1]), [*dofs, k])

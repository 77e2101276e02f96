"""Random models of branches in branches, and what they mean: mpmath on the tree that was drawn.

Every side may lack a value where another one is taken.  The meaning is evaluated on plain tuples,
side by side as the branches say, and differentiated by differences in 80 digits: nothing of SymPy
or of the generator is in it.
"""

from __future__ import annotations

import random
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import mpmath
import sympy as sp

from softehl.codegen.language.definition import Definition
from softehl.codegen.language.elements import quadrature
from softehl.codegen.language.model import Model

Tree = tuple[Any, ...]
LEAVES = ("T", "x", "g", "k")
KINDS = ["+", "-", "*", "pieces", "pieces", "pieces", "sqrt", "log", "1/", "3/2", "named", "max"]
DIGITS, STEP = 80, mpmath.mpf(10) ** -20
RULE = quadrature.gauss(2, 1)


class NoValueError(ArithmeticError):
    """A state without a value, or so near to a kink that the side cannot be told."""


def drawn(rng: random.Random, depth: int) -> Tree:
    """A tree of operations."""
    if depth == 0 or rng.random() < 0.1:
        if rng.random() < 0.3:
            return ("number", sp.Rational(rng.randint(-9, 9), rng.randint(2, 7)))
        return (rng.choice(LEAVES),)
    kinds = [
        "+",
        "-",
        "*",
        "pieces",
        "pieces",
        "pieces",
        "sqrt",
        "log",
        "1/",
        "3/2",
        "named",
        "max",
    ]
    kind = rng.choice(kinds)
    count = {"sqrt": 1, "log": 1, "1/": 1, "3/2": 1, "named": 1, "pieces": 4}.get(kind, 2)
    inside = [drawn(rng, depth - 1) for _ in range(count)]
    return (kind, *inside, *([rng.random() < 0.5] if kind == "pieces" else []))


def value(tree: Tree, at: Mapping[str, Any]) -> Any:
    """Real value of a tree; raises NoValueError."""
    kind, *parts = tree
    if kind == "number":
        return mpmath.mpf(int(parts[0].p)) / int(parts[0].q)
    if kind in LEAVES:
        return at[kind]
    if kind == "pieces":
        a, b, then, otherwise, _strict = parts
        left, right = value(a, at), value(b, at)
        return value(then if _less(left, right) else otherwise, at)
    args = [value(p, at) for p in parts]
    if kind == "max":
        return args[1] if _less(*args) else args[0]
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


def _less(a: Any, b: Any) -> bool:
    if abs(a - b) < mpmath.mpf(10) ** -9:
        raise NoValueError
    return bool(a < b)


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
        written = self._written(m, self.energy, known, {})
        m.potential(m.integral("Pi", written + (T**2 + field**2) / 2 + k * T))
        m.offer(product=True, pseudo_load=True, derivatives=[k])
        return m.finish()

    def _written(
        self, m: Model, tree: Tree, known: Mapping[str, Any], names: dict[Tree, Any]
    ) -> Any:
        kind, *parts = tree
        if kind == "number":
            return parts[0]
        if kind in LEAVES:
            return known[kind]
        args = [self._written(m, p, known, names) for p in parts if isinstance(p, tuple)]
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

    def tangent(self, dofs: Sequence[float], k: float) -> tuple[list[Any], list[list[Any]]]:
        """Residual and its derivatives by the unknowns and, in the last column, by k."""
        with mpmath.workdps(DIGITS):
            base = [mpmath.mpf(v) for v in (*dofs, k)]
            n, h = len(base), STEP

            def at(*moves: tuple[int, int]) -> Any:
                moved = list(base)
                for i, s in moves:
                    moved[i] += s * h
                return self.total(moved[:-1], moved[-1])

            R = [(at((i, 1)) - at((i, -1))) / (2 * h) for i in range(n - 1)]
            K = [[self._second(at, i, j) / (4 * h * h) for j in range(n)] for i in range(n - 1)]
            return R, K

    @staticmethod
    def _second(at: Any, i: int, j: int) -> Any:
        pairs = [(1, 1, 1), (-1, -1, 1), (1, -1, -1), (-1, 1, -1)]
        return sum(sign * at((i, a), (j, b)) for a, b, sign in pairs)

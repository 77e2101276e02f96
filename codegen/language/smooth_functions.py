"""Functions of a page that are smooth at zero: `m.sinc`, `m.cosc`, `m.rotation` and its inverse."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import sympy as sp

from softehl.codegen.graph.bessel import bessel
from softehl.codegen.language.errors import ModelError
from softehl.codegen.language.flatten import Entries, Matrix
from softehl.codegen.language.sympy_lowering import Symbols

HALVINGS = 4
"""Of an angle up to 120 degrees, after which eight terms of the series of atan are exact."""


class SmoothFunctions:
    """Smooth functions of one model, with numbers for their names."""

    def __init__(self, symbols: Symbols, define: Callable[[str, Any], Any]) -> None:
        self._symbols, self._define = symbols, define
        self._count = 0

    def sinc(self, x: Any) -> Any:
        """Name of sin(x) / x."""
        return self._of_length([_scalar("m.sinc", x)])

    def cosc(self, x: Any) -> Any:
        """(1 - cos(x)) / x^2, half the square of sin(x/2) / (x/2)."""
        return self._of_length([_scalar("m.cosc", x) / 2]) ** 2 / 2

    def rotation(self, w: Any) -> Any:
        """Rotation by the length of w about w, by Rodrigues' formula."""
        v = Entries.of(w).values
        if len(v) != 3:
            raise ModelError(f"m.rotation: w has {len(v)} entries, must have 3: a rotation vector")
        W = Matrix([[0, -v[2], v[1]], [v[2], 0, -v[0]], [-v[1], v[0], 0]])
        half = self._of_length([a / 2 for a in v])
        return sp.eye(3) + self._of_length(v) * W + half**2 / 2 * (W * W)

    def rotation_vector(self, R: Any, *, branches: bool = True) -> Any:
        """Rotation vector of a rotation, of a length of at most pi.

        By the half angle: its cosine s and its sine times the axis, v, from the largest of trace
        and diagonal (S. W. Shepperd, J. Guidance and Control 1 (1978) 223). Without branches from
        the trace alone: four times fewer operations, and digits are lost near half a turn.
        """
        if getattr(R, "shape", None) != (3, 3):
            shape = getattr(R, "shape", "that of a scalar or list")
            raise ModelError(f"m.rotation_vector: R has shape {shape}, must be (3, 3)")
        self._count += 1
        label = f"turn_{self._count}"

        def named(name: str, value: Any) -> Any:
            return self._define(f"{label}_{name}", value)

        trace = named("trace", R[0, 0] + R[1, 1] + R[2, 2])
        if not branches:
            s, *v = (named(f"half_{k}", a) for k, a in enumerate(_by_trace(R, trace)))
            z = named("ratio", sum(a**2 for a in v) / s**2)
            factor = named("factor", 2 * _half_angle(z) / s)
            return Matrix([a * factor for a in v])
        first = sp.And(R[0, 0] >= R[1, 1], R[0, 0] >= R[2, 2])
        conditions = (trace > 0, first, R[1, 1] >= R[2, 2], True)
        sides = [_by_trace(R, trace), *(_by_diagonal(R, trace, i) for i in range(3))]
        s, *v = (
            named(f"half_{k}", sp.Piecewise(*zip(values, conditions, strict=True)))
            for k, values in enumerate(zip(*sides, strict=True))
        )
        square = named("square", sum(a**2 for a in v))
        z = named("ratio", sp.Piecewise((square / s**2, trace > 0), (0, True)))
        length = sp.sqrt(square)
        half_turn = sp.Piecewise((-sp.pi, s < 0), (sp.pi, True))
        large = (half_turn - 2 * sp.atan(s / length)) / length
        factor = sp.Piecewise((2 * _half_angle(z) / s, trace > 0), (large, True))
        factor = named("factor", factor)
        return Matrix([a * factor for a in v])

    def _of_length(self, v: Sequence[Any]) -> Any:
        symbols = self._symbols
        self._count += 1
        label = f"sinc_{self._count}"
        graph = symbols.graph
        (node,) = graph.run(bessel(0, len(v)), [symbols.lower(a) for a in v])
        name = symbols.name(label, graph.name(label, node), list(v), has_definition=False)
        x = sp.sqrt(sum(a**2 for a in v)) if len(v) > 1 else v[0]
        written = sp.Piecewise((sp.sin(x) / x, sp.Ne(x, 0)), (sp.Integer(1), True))
        return symbols.record.define(name, written)


def _by_trace(R: Any, trace: Any) -> list[Any]:
    """Cosine of the half angle and its sine times the axis, of angles below 120 degrees."""
    s = sp.sqrt(1 + trace) / 2
    pairs = ((2, 1), (0, 2), (1, 0))
    return [s, *((R[j, k] - R[k, j]) / (4 * s) for j, k in pairs)]


def _by_diagonal(R: Any, trace: Any, i: int) -> list[Any]:
    """Cosine and sine times axis, where the latter is largest along axis i."""
    j, k = (i + 1) % 3, (i + 2) % 3
    largest = sp.sqrt(1 + 2 * R[i, i] - trace) / 2
    v = [largest] * 3
    v[j], v[k] = ((R[i, a] + R[a, i]) / (4 * largest) for a in (j, k))
    return [(R[k, j] - R[j, k]) / (4 * largest), *v]


def _half_angle(z: Any) -> Any:
    """atan(t) / t as a function of z = t^2 < 3: tan(a/2) = tan(a) / (1 + sqrt(1 + tan(a)^2))."""
    factor = sp.Integer(1)
    for _ in range(HALVINGS):
        half = 1 + sp.sqrt(1 + z)
        factor, z = factor * 2 / half, z / half**2
    series = sp.Integer(0)
    for k in range(7, -1, -1):
        series = sp.Rational(1, 2 * k + 1) - z * series
    return factor * series


def _scalar(what: str, x: Any) -> Any:
    if isinstance(x, (sp.MatrixBase, list, tuple)):
        raise ModelError(f"{what}: {x} is no scalar; of a vector m.rotation")
    return sp.sympify(x)

"""Random pages of fields on every cell, and what they mean: mpmath on the trees that were drawn.

The meaning is virtual work in many digits, summed over the points of the rule with shape functions
that follow from the monomials of a cell, local unknowns in closed form and eigenvalues of C. It is
differentiated by differences along random directions: nothing of SymPy or of the generator is in
it but the points of the rule.
"""

from __future__ import annotations

import random
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cache, cached_property
from itertools import product
from typing import Any

import mpmath
import sympy as sp

from softehl.codegen.language.definition import Definition
from softehl.codegen.language.fields import Fields
from softehl.codegen.language.weak_form import Form, Page
from softehl.runtime.mesh.cells import CELLS
from tests.codegen.nested_models import DIGITS, STEP, NoValueError, Tree, drawn, value, written

Q = sp.Rational
Values = list[Any]
Point = Mapping[str, Any]
NEAR = mpmath.mpf(10) ** -9
FIRST = {"tri": (0, 1), "quad": (0, 1), "tet": (0, 2, 1)}
"""Corners of the face of a cell that a facet is."""
STRETCHES = ("log", "split", "macaulay", "trace", "coupled", "largest")
TASKS = ("product", "pseudo_load", "fields_rate", "d_k")
LOCAL = ("cubic", "ramp", "pair")
SQUARES = ("T", "b", "S", "d_x", "jump", "mean")
LINEAR = ("k", "q", "h", "S_old", "rate", "power", "jump_old", "jump_rate")
"""Leaves that every energy has, squared and times S."""


@cache
def _coefficients(cell: str) -> tuple[list[tuple[int, ...]], Any]:
    """Exponents of the monomials of a cell and the coefficients of its shape functions."""
    nodes = CELLS[cell].nodes.tolist()
    shape, size = cell.rstrip("0123456789"), len(nodes[0])
    order = max(1, len({round(n[0], 9) for n in nodes}) - 1)
    exponents = list(product(range(order + 1), repeat=size))
    if shape in ("tri", "tet"):
        exponents = [e for e in exponents if sum(e) <= order]
    if shape == "wedge":
        exponents = [e for e in exponents if e[0] + e[1] <= 1]
    if cell in ("quad8", "hex20"):
        exponents = [e for e in exponents if e.count(2) <= 1]
    with mpmath.workdps(DIGITS):
        powers = mpmath.matrix([[_monomial(e, n) for e in exponents] for n in nodes])
        return exponents, powers**-1


def _monomial(exponents: Sequence[int], place: Sequence[Any], by: int | None = None) -> Any:
    found = mpmath.mpf(1)
    for k, (e, x) in enumerate(zip(exponents, place, strict=True)):
        x = mpmath.mpf(x)
        if k == by:
            found *= e * x ** (e - 1) if e else 0
        else:
            found *= x**e
    return found


def shapes(cell: str, place: Sequence[Any], by: int | None = None) -> Values:
    """Shape functions of a cell at a place, or their derivatives."""
    exponents, coefficients = _coefficients(cell)
    terms = [_monomial(e, place, by) for e in exponents]
    return [
        mpmath.fsum(t * coefficients[k, a] for k, t in enumerate(terms)) for a in range(len(terms))
    ]


def det(M: Sequence[Sequence[Any]]) -> Any:
    """Determinant by its first row."""
    if len(M) == 1:
        return M[0][0]
    return sum(
        (-1) ** k * M[0][k] * det([[*r[:k], *r[k + 1 :]] for r in M[1:]]) for k in range(len(M))
    )


def inverse(M: Sequence[Sequence[Any]]) -> list[Values]:
    """Inverse by cofactors."""
    size, whole = range(len(M)), det(M)
    if len(M) == 1:
        return [[1 / whole]]

    def minor(i: int, k: int) -> Any:
        return det([[M[r][c] for c in size if c != k] for r in size if r != i])

    return [[(-1) ** (i + k) * minor(k, i) / whole for k in size] for i in size]


@dataclass
class Sides:
    """Decisions of conditions, in their order; `near` of them have no value."""

    near: Any = NEAR

    def __post_init__(self) -> None:
        self.taken: list[bool] = []

    def less(self, a: Any, b: Any) -> bool:
        """Whether a < b.  Raises NoValueError where they are too near."""
        if abs(a - b) < self.near:
            raise NoValueError
        self.taken.append(bool(a < b))
        return self.taken[-1]


@dataclass(frozen=True)
class RandomPage:
    """A page: energy and fluxes of trees, and the cell it is on.

    fluxes: pairs of a tree and a leaf that is varied. stretches: an energy of `STRETCHES`.
    local: one of `LOCAL`, with the trees of its equations. tasks: further ones, of `TASKS`.
    """

    name: str
    cell: str
    geometry: str
    form: Form | None
    energy: Tree
    fluxes: tuple[tuple[Tree, str], ...]
    stretches: str
    local: str
    sources: tuple[Tree, Tree]
    history: Tree
    tasks: tuple[str, ...]

    @property
    def kind(self) -> str:
        """The cell without its facet."""
        return self.cell.partition("_")[0]

    @property
    def size(self) -> int:
        """Of space."""
        return CELLS[self.kind].dimension

    @property
    def corners(self) -> str:
        """The cell of the field of order 1."""
        shape = self.kind.rstrip("0123456789")
        return f"{shape}{CELLS[self.kind].corners}"

    @property
    def on_facet(self) -> bool:
        """Whether gradients are those of cells beside a facet."""
        return "_" in self.cell

    # the page -------------------------------------------------------------------------------------

    def write(self, m: Fields) -> None:
        """What the page says."""
        facet = self.on_facet
        known: dict[str, Any] = {} if facet else {"T": m.scalar("T", order=0)}
        d = m.vector("d")
        S = m.scalar("S", order=None if facet or self.kind == self.corners else 1)
        if not facet:
            known["b"] = m.internal("b")
        known |= m_values(m)
        g = m.grad(S)
        n = m.norm(g)
        known |= {"S": S, "S_x": g[0], "d_x": d[0], "X": m.position[0], "S_old": m.previous(S)}
        known |= {"rate": m.rate(S), "cosh": sp.cosh(n), "power": n ** known["p"], "cube": n**3}
        F = m.deformation_gradient(d)
        known["J"] = m.define("J", F.det())
        if facet:
            known |= {"jump": m.jump(S), "mean": m.average(m.grad(d).trace())}
            known["normal"] = m.normal[0]
            known |= {"jump_old": m.jump(known["S_old"]), "jump_rate": m.jump(known["rate"])}
            known |= {"size": m.size, "jump_J": m.jump(known["J"])}
        names: dict[Tree, Any] = {}
        known |= self._local(m, known, names)
        known["W"] = m.principal("W", F.T * F, lambda *a: self._of_stretches(a, known["k"]))
        tree = written(m, self.energy, known, names)
        squares = sum(known[v] ** 2 for v in SQUARES if v in known) / 2
        m.minimise(
            tree + known["W"] + squares + n**2 + sum(known[v] for v in LINEAR if v in known) * S
        )
        for flux, varied in self.fluxes:
            m.weak(written(m, flux, known, names), known[varied])
        new = written(m, self.history, known, names)
        m.history(h=new)
        m.fields(seen=new * known["J"])
        m.offer(
            product="product" in self.tasks,
            pseudo_load="pseudo_load" in self.tasks,
            fields_rate="fields_rate" in self.tasks,
            derivatives=[known["k"]] if "d_k" in self.tasks else [],
        )

    def _local(self, m: Fields, known: Mapping[str, Any], names: dict[Tree, Any]) -> dict[str, Any]:
        a, b = (written(m, tree, known, names) for tree in self.sources)
        if self.local == "pair":
            s, t = m.implicit(
                "s",
                lambda s: [s[0] ** 3 + s[0] + s[1] - a, s[1] - s[0] / 2 - b],
                start=[known["h"], known["h"]],
            )
            return {"s": s, "t": t}
        if self.local == "ramp":
            return {"s": m.implicit("s", lambda s: s + sp.Max(s, 0) ** 2 - a, start=0)}
        return {"s": m.implicit("s", lambda s: s**3 + s - a, start=known["h"])}

    def _of_stretches(self, a: Sequence[Any], k: Any) -> Any:
        match self.stretches:
            case "log":
                return k * sum(sp.log(x) ** 2 for x in a)
            case "split":
                return sum(sp.Piecewise((2 * (x - 1) ** 2, x > 1), ((x - 1) ** 2, True)) for x in a)
            case "macaulay":
                return sum(sp.Max(x**2 - 1, 0) ** 2 for x in a)
            case "trace":
                some = sum((x - 1) ** 2 for x in a)
                return sp.Piecewise((some, sum(a) < Q(31, 10)), (some + sp.log(sp.prod(a)), True))
            case "coupled":
                return (sp.prod(a) - 1) ** 2 + k * sum(x**3 for x in a)
        return sp.Max(*a) ** 2

    def page(self) -> Page:
        """It, as a user has it."""
        return Page(self.name, self.write, form=self.form)

    def definition(self) -> Definition:
        """The model."""
        return self.page().definition(self.cell, self.geometry)


def m_values(m: Fields) -> dict[str, Any]:
    """Parameters and data of a page."""
    k, p = m.parameters(k="number", p="exponent")
    (q,) = m.data(q="number of a cell")
    (h,) = m.point_data(h="number of the step before")
    return {"k": k, "p": p, "q": q, "h": h}


# ------------------------------------------------------------------------------------- the meaning


class Meaning:
    """Work of a page in many digits; `z` holds coordinates, data, parameters and unknowns."""

    def __init__(
        self, page: RandomPage, names: Sequence[str], rule: Sequence[Sequence[Any]]
    ) -> None:
        """names: of the entries of z.  rule: point and weight, in rows."""
        self.page, self.sides = page, Sides()
        self.index = {name: k for k, name in enumerate(names)}
        with mpmath.workdps(DIGITS):
            self.rule = [[mpmath.mpf(v.numerator) / v.denominator for v in row] for row in rule]
        self.history: Values = [mpmath.mpf(0)] * len(rule)

    @cached_property
    def tables(self) -> list[list[dict[str, list[Values]]]]:
        """By point and cell: shape functions and their derivatives, of the cell and its corners."""
        p = self.page
        found = []
        for *at, _weight in self.rule:
            places = [self._place(at, second) for second in range(p.cell.endswith("_interior") + 1)]
            places = places if p.on_facet else [at]
            cells = {p.kind, p.corners}
            found.append(
                [
                    {c: [shapes(c, x), *(shapes(c, x, k) for k in range(p.size))] for c in cells}
                    for x in places
                ]
            )
        return found

    def _place(self, at: Sequence[Any], second: int) -> Values:
        """Place in a cell of a point of its facet."""
        shape = self.page.kind.rstrip("0123456789")
        if shape not in FIRST:
            return []
        corners = [CELLS[self.page.kind].nodes[c].tolist() for c in FIRST[shape]]
        if second:
            corners = [corners[(1 - k) % len(corners)] for k in range(len(corners))]
        if len(at) == 1:
            weights = [(1 - at[0]) / 2, (1 + at[0]) / 2]
        elif len(at) == len(corners) - 1:
            weights = [1 - sum(at), *at]
        else:
            return []
        return [
            sum(w * c[i] for w, c in zip(weights, corners, strict=True))
            for i in range(len(corners[0]))
        ]

    def _field(self, z: Values, name: str, table: Values, first: int = 0) -> Any:
        """Sum over nodes."""
        index = self.index
        return sum(z[index[f"{name}{first + a + 1}"]] * N for a, N in enumerate(table))

    def _beside(self, z: Values, q: int, second: int) -> dict[str, Any]:
        """Values and slopes at a point, in one cell."""
        p, tables = self.page, self.tables[q][second]
        axes, size = "XYZ"[: p.size], range(p.size)
        own, low = tables[p.kind], tables[p.kind if p.on_facet else p.corners]
        first = second * len(own[0])
        dX = [[self._field(z, x, own[1 + k], first) for k in size] for x in axes]
        back = inverse(dX)

        def slopes(name: str, table: list[Values]) -> Values:
            parent = [self._field(z, name, table[1 + k], first) for k in size]
            return [sum(parent[k] * back[k][i] for k in size) for i in size]

        d = [f"d_{x}" for x in "xyz"[: p.size]]
        found = {
            "dX": dX,
            "X": [self._field(z, x, own[0], first) for x in axes],
            "d": [self._field(z, name, own[0], first) for name in d],
            "H": [slopes(name, own) for name in d],
            "S": self._field(z, "S", low[0], first),
            "g": slopes("S", low),
            "S_old": self._field(z, "S_old", low[0], first),
            "S_rate": self._field(z, "S_rate", low[0], first),
        }
        F = [[mpmath.mpf(i == k) for k in range(3)] for i in range(3)]
        for i in size:
            for k in size:
                F[i][k] += found["H"][i][k]
        if p.geometry == "axisymmetric":
            F[2][2] += found["d"][1] / found["X"][1]
        return found | {"F": F}

    def at(self, z: Values, q: int) -> tuple[dict[str, Any], Any]:
        """Leaves at a point, and its volume."""
        p = self.page
        sides = [self._beside(z, q, k) for k in range(len(self.tables[q]))]
        a = sides[0]
        found: dict[str, Any] = {
            k: z[self.index[k]] for k in ("k", "p", "q", "T", "b") if k in self.index
        }
        n = mpmath.sqrt(sum(v * v for v in a["g"]))
        found |= {"h": self.history[q], "S": a["S"], "S_x": a["g"][0], "d_x": a["d"][0]}
        found |= {"X": a["X"][0], "S_old": a["S_old"], "n": n, "J": det(a["F"])}
        found |= {"rate": z[self.index["rate"]] * a["S"] + a["S_rate"]}
        found |= {"cosh": mpmath.cosh(n), "cube": n**3, "power": n ** found["p"]}
        volume = det(a["dX"])
        if p.on_facet:
            volume = self._facet(found, sides, z[self.index["rate"]])
        if p.geometry == "axisymmetric":
            volume *= 2 * mpmath.pi * a["X"][1]
        found |= self._local(found)
        found["W"] = self._stretches(a["F"], found["k"])
        return found, volume * self.rule[q][-1]

    def _facet(self, found: dict[str, Any], sides: Sequence[Mapping[str, Any]], factor: Any) -> Any:
        """Leaves of a facet; its area."""
        shape = self.page.kind.rstrip("0123456789")
        corners = [CELLS[self.page.kind].nodes[c].tolist() for c in FIRST[shape]]
        flat = len(corners) == 2
        along = [
            [(e - s) / (2 if flat else 1) for s, e in zip(corners[0], c, strict=True)]
            for c in corners[1:]
        ]
        t = [
            [sum(r * c for r, c in zip(row, line, strict=True)) for row in sides[0]["dX"]]
            for line in along
        ]
        if flat:
            vector = [t[0][1], -t[0][0]]
        else:
            x, y = t
            vector = [
                x[1] * y[2] - x[2] * y[1],
                x[2] * y[0] - x[0] * y[2],
                x[0] * y[1] - x[1] * y[0],
            ]
        area = mpmath.sqrt(sum(v * v for v in vector))
        a, b = sides[0], sides[-1]
        one = len(sides) == 1
        parent = {"tri": mpmath.mpf(1) / 4, "quad": mpmath.mpf(2), "tet": mpmath.mpf(1) / 3}[shape]
        found["jump"] = a["S"] if one else a["S"] - b["S"]
        found["jump_J"] = det(a["F"]) - (0 if one else det(b["F"]))
        found["jump_old"] = a["S_old"] - (0 if one else b["S_old"])
        found["jump_rate"] = factor * found["jump"] + a["S_rate"] - (0 if one else b["S_rate"])
        found["mean"] = sum(a["H"][i][i] + b["H"][i][i] for i in range(self.page.size)) / 2
        found["normal"] = vector[0] / area
        found["size"] = parent * (det(a["dX"]) + det(b["dX"])) / 2 / area
        return area

    def _local(self, at: Point) -> dict[str, Any]:
        a, b = (value(tree, at, self.sides.less) for tree in self.page.sources)
        if abs(a) > 100 or abs(b) > 100:
            raise NoValueError
        match self.page.local:
            case "pair":
                s = _cubic(mpmath.mpf(3) / 2, a - b)
                return {"s": s, "t": b + s / 2}
            case "ramp":
                below = self.sides.less(a, mpmath.mpf(0))
                return {"s": a if below else (mpmath.sqrt(1 + 4 * a) - 1) / 2}
        return {"s": _cubic(mpmath.mpf(1), a)}

    def _stretches(self, F: Sequence[Sequence[Any]], k: Any) -> Any:
        """Energy of the roots of the eigenvalues of C."""
        if det(F) <= 0.05:
            raise NoValueError
        C = [[sum(F[i][r] * F[i][c] for i in range(3)) for c in range(3)] for r in range(3)]
        if self.page.size < 3:
            mean, half = (C[0][0] + C[1][1]) / 2, (C[0][0] - C[1][1]) / 2
            off = mpmath.sqrt(half * half + C[0][1] ** 2)
            a = [mpmath.sqrt(v) for v in (mean + off, mean - off, C[2][2])]
        else:
            a = [mpmath.sqrt(v) for v in mpmath.eigsy(mpmath.matrix(C), eigvals_only=True)]
        fixed = a[2] == 1 and self.page.size < 3 and self.page.geometry != "axisymmetric"
        free = a[:2] if fixed else a
        less, one = self.sides.less, mpmath.mpf(1)
        match self.page.stretches:
            case "log":
                return k * sum(mpmath.log(x) ** 2 for x in a)
            case "split":
                return sum((2 - less(x, one)) * (x - 1) ** 2 for x in free)
            case "macaulay":
                return sum(0 if less(x, one) else (x * x - 1) ** 2 for x in free)
            case "trace":
                some = sum((x - 1) ** 2 for x in a)
                low = less(sum(a), mpmath.mpf(31) / 10)
                return some if low else some + mpmath.log(a[0] * a[1] * a[2])
            case "coupled":
                return (a[0] * a[1] * a[2] - 1) ** 2 + k * sum(x**3 for x in a)
        top = a[0]
        for x in a[1:]:
            top = x if less(top, x) else top
        return top**2

    # work and its derivatives ---------------------------------------------------------------------

    def energy(self, z: Values) -> Any:
        """The integral of what is minimised."""
        return sum(self._density(*self.at(z, q)) for q in range(len(self.rule)))

    def _density(self, at: Point, volume: Any) -> Any:
        found = value(self.page.energy, at, self.sides.less) + at["W"] + at["n"] ** 2
        found += sum(at[v] ** 2 for v in SQUARES if v in at) / 2
        return (found + sum(at[v] for v in LINEAR if v in at) * at["S"]) * volume

    def virtual(self, z: Values, w: Values) -> Any:
        """Residual times w."""
        found, less = mpmath.mpf(0), self.sides.less
        ends = [moved(z, sign, w) for sign in (1, -1)]
        for q in range(len(self.rule)):
            (a, volume_a), (b, volume_b) = (self.at(x, q) for x in ends)
            found += self._density(a, volume_a) - self._density(b, volume_b)
            if self.page.fluxes:
                here, volume = self.at(z, q)
                found += volume * sum(
                    value(flux, here, less) * (a[varied] - b[varied])
                    for flux, varied in self.page.fluxes
                )
        return found / (2 * STEP)

    def fields(self, z: Values) -> Values:
        """The two fields at the points: what is seen, then the new history."""
        found = []
        for q in range(len(self.rule)):
            at, _ = self.at(z, q)
            new = value(self.page.history, at, self.sides.less)
            found.append([new * at["J"], new])
        return found

    def slope(self, f: Callable[[Values], Any], z: Values, r: Values) -> Any:
        """Derivative of a number along r."""
        a, b = (f(moved(z, sign, r)) for sign in (1, -1))
        return (a - b) / (2 * STEP)

    def decisions(self, z: Values) -> tuple[bool, ...] | None:
        """What all conditions decide at z; None without a value there."""
        self.sides = Sides(mpmath.mpf(0))
        try:
            self.energy(z)
            self.fields(z)
            return tuple(self.sides.taken)
        except NoValueError:
            return None
        finally:
            self.sides = Sides()


def moved(z: Values, sign: int, r: Values) -> Values:
    """z one step along r."""
    return [x + sign * STEP * y for x, y in zip(z, r, strict=True)]


def _cubic(p: Any, c: Any) -> Any:
    """The real root of s^3 + p s = c, p > 0."""
    return (
        2 * mpmath.sqrt(p / 3) * mpmath.sinh(mpmath.asinh(3 * c / (2 * p) * mpmath.sqrt(3 / p)) / 3)
    )


# -------------------------------------------------------------------------------------- the drawing

PLACES: tuple[tuple[str, str, Form | None], ...] = (
    ("quad4", "plane strain", "whole"),
    ("quad4", "plane strain", "point"),
    ("tri3", "plane strain", "whole"),
    ("tri3_interior", "plane strain", None),
    ("tri6", "plane strain", "point"),
    ("quad4", "axisymmetric", "point"),
    ("quad4_interior", "plane strain", None),
    ("quad8", "plane strain", "point"),
    ("tet4", "solid", "whole"),
    ("wedge6", "solid", "point"),
    ("tri3", "axisymmetric", "whole"),
    ("hex8", "solid", "point"),
    ("quad4_side", "axisymmetric", None),
    ("quad9", "plane strain", "point"),
    ("tet4_interior", "solid", None),
    ("line3", "solid", "point"),
)
BASE = ("S", "S_x", "X", "k", "q", "h", "S_old", "rate", "d_x", "J", "cosh", "power", "cube")
ON_CELLS, ON_FACETS = (
    ("T", "T", "b", "b"),
    ("jump", "jump_rate", "jump_J", "mean", "normal", "size"),
)


def random_page(seed: int, attempt: int = 0) -> RandomPage:
    """The page of a seed; another one on the same cell with every attempt."""
    rng = random.Random(1000 * seed + attempt)
    cell, geometry, form = PLACES[seed % len(PLACES)]
    base = (*BASE, *(ON_FACETS if "_" in cell else ON_CELLS))
    local = rng.choice(LOCAL)
    own = ("s", "s", *(("t", "t") if local == "pair" else ()))
    leaves = (*base, *own, "W")
    energy = drawn(rng, 3, (*base, *own))
    varied = [x for x in leaves if x not in ("X", "k", "q", "h", "S_old", "normal", "size")]
    fluxes = tuple((drawn(rng, 2, leaves), rng.choice(varied)) for _ in range(rng.randint(0, 2)))
    return RandomPage(
        f"page_{seed}",
        cell,
        geometry,
        form,
        energy,
        fluxes,
        rng.choice(STRETCHES),
        local,
        (drawn(rng, 2, base), drawn(rng, 1, base)),
        drawn(rng, 2, (*leaves, *own)),
        tuple(rng.sample(TASKS, 2)),
    )

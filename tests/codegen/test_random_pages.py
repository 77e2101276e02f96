"""Kernels of random pages of fields on all cells, against what the pages mean in many digits."""

from __future__ import annotations

import random
import re
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import mpmath
import numpy as np
import pytest
import sympy as sp

from softehl.codegen import pipeline
from softehl.codegen.language.definition import Definition
from softehl.codegen.language.errors import ModelError
from softehl.codegen.tools import build, output_files
from softehl.runtime.arrays import Array
from softehl.runtime.kernels.kernel import load_kernel
from softehl.runtime.mesh.cells import CELLS
from tests.codegen.nested_models import DIGITS, STEP, NoValueError
from tests.codegen.random_pages import FIRST, TASKS, Meaning, RandomPage, moved, random_page

PAGES = 16
NOT_REAL = re.compile("real numbers|non-real|not comparable|NaN|nan|zoo|oo|zero|imaginary")
KINDS = ("rest", "equal", "nearly equal", "any", "any", "any", "kink", "kink")


@dataclass
class Comparison:
    """A kernel and the meaning of its page."""

    kernel: Any  # of a page, or its definition, which has no values
    meaning: Meaning
    rng: random.Random

    def __post_init__(self) -> None:
        axes, k = "XYZ"[: self.meaning.page.size], self.kernel
        self.nodes = _nodes(self.meaning.page)
        self.places = [f"{x}{a + 1}" for a in range(len(self.nodes)) for x in axes]
        self.data, self.parameters, self.unknowns = (
            [str(getattr(x, "name", x)) for x in some]
            for some in (k.data, k.parameters, k.unknowns)
        )
        names = (*self.places, *self.data, *self.parameters, *self.unknowns)
        self.meaning.index.update({name: n for n, name in enumerate(names)})
        self.names = names
        self.ends = np.cumsum([len(self.places), len(self.data), len(self.parameters)])

    def split(self, z: Array) -> list[Array]:
        """Coordinates, data, parameters and unknowns."""
        return np.split(z, self.ends)

    def any_state(self, kind: str) -> Array:
        """A random state, with special values of the unknowns."""
        rng, page = self.rng, self.meaning.page
        X = self.nodes + np.array([[rng.uniform(-0.1, 0.1) for _ in row] for row in self.nodes])
        X[:, -1] += 2.0 * (page.geometry == "axisymmetric")
        chosen = {name: rng.uniform(-0.8, 0.8) for name in (*self.data, *self.unknowns)}
        chosen |= {name: rng.uniform(-0.1, 0.1) for name in self.unknowns if name.startswith("d_")}
        chosen |= {"k": rng.uniform(0.5, 1.5), "p": float(rng.choice([2, 3, 4])), "rate": 0.7}
        self.meaning.history = [mpmath.mpf(rng.uniform(-0.5, 0.5)) for _ in self.meaning.rule]
        if kind == "rest":
            chosen |= dict.fromkeys(self.unknowns, 0.0)
        if "equal" in kind:
            stretch, small = rng.uniform(-0.2, 0.3), 1e-7 * ("nearly" in kind)
            for axis, column in zip("xyz", X.T, strict=False):
                for a, x in enumerate(column):
                    chosen[f"d_{axis}{a + 1}"] = stretch * x + small * rng.uniform(-1, 1)
            one = chosen["S1"]  # no gradient
            chosen |= {name: one for name in self.unknowns if name.startswith("S")}
        return np.array([*X.ravel(), *(chosen[n] for n in self.names[len(self.places) :])])

    def states(self) -> Iterator[tuple[str, Array]]:
        """States of all kinds; those at a kink come in pairs."""
        for kind in KINDS:
            z = self.any_state(kind)
            for _ in range(8):
                if self._decisions(z) is not None:
                    break
                z = self.any_state(kind)
            if kind == "kink":
                history = self.meaning.history
                other = self.any_state("any")
                other[: self.ends[-1]] = z[: self.ends[-1]]
                self.meaning.history = history
                yield from (("kink", end) for end in self._sides_of_a_kink(z, other))
            else:
                yield kind, z

    def _sides_of_a_kink(self, a: Array, b: Array) -> Sequence[Array]:
        """Two neighbours between a and b where a condition decides otherwise."""
        left, right = (self._decisions(z) for z in (a, b))
        if left is None or right is None or left == right:
            return ()
        for _ in range(20):
            middle = (a + b) / 2
            there = self._decisions(middle)
            if there is None:
                return ()
            a, b = (middle, b) if there == left else (a, middle)
        return a, b

    def has_value(self, z: Array) -> bool:
        """Whether all branches at a state have values, none of them large."""
        with mpmath.workdps(30):
            try:
                exact = [mpmath.mpf(v) for v in z]
                size = abs(self.meaning.virtual(exact, [v * 0 + 1 for v in exact]))
                return bool(size < 1e3)
            except NoValueError:
                return False

    def _decisions(self, z: Array) -> tuple[bool, ...] | None:
        with mpmath.workdps(30):
            return self.meaning.decisions([mpmath.mpf(v) for v in z])

    def agrees(self, z: Array) -> bool:
        """Compare all tasks at a state; False without a value there.  Raises AssertionError."""
        with mpmath.workdps(DIGITS):
            try:
                expected = self._expected(z)
            except NoValueError:
                return False
        found = self._found(z)
        scale = max(1.0, *(np.abs(v).max() for v in self.arrays))
        if max(np.abs(np.array(v)).max() for v in expected.values()) > 1e6:
            return False  # rounding is large there
        for task, right in expected.items():
            np.testing.assert_allclose(
                found[task], right, rtol=0, atol=1e-9 * scale, err_msg=f"{task} of {self.kernel}"
            )
        return True

    def _directions(self, z: Array) -> tuple[Array, Array]:
        """Of the unknowns, and of everything."""
        signs = np.random.default_rng(5)
        w, r = (signs.uniform(0.3, 1.0, len(z)) * signs.choice([-1, 1], len(z)) for _ in range(2))
        w[: self.ends[-1]] = 0.0
        return w, r

    def _expected(self, z: Array) -> dict[str, Array]:
        w, r = self._directions(z)
        exact = [mpmath.mpf(v) for v in z]
        parts = [np.zeros(len(z)) for _ in range(3)]
        parts[0][self.ends[-1] :] = r[self.ends[-1] :]
        parts[1][: self.ends[-1]] = r[: self.ends[-1]]
        parts[2][self.names.index("k")] = 1.0
        along = [[mpmath.mpf(v) for v in x] for x in (w, r, *parts)]
        meaning = self.meaning

        def virtual(x: list[Any]) -> Any:
            return meaning.virtual(x, along[0])

        found: dict[str, Any] = {"residual": virtual(exact)}
        for task, by in zip(("tangent", "pseudo_load", "d_k"), along[2:], strict=True):
            if task not in self.kernel.tasks:
                continue
            found[task] = meaning.slope(virtual, exact, by)
        found["fields"] = meaning.fields(exact)
        ends = [meaning.fields(moved(exact, sign, along[1])) for sign in (1, -1)]
        found["fields_rate"] = (np.array(ends[0]) - np.array(ends[1])) / (2 * STEP)
        if not meaning.page.fluxes:
            found["energy"] = meaning.energy(exact)
        found["product"] = found["tangent"]
        tasks = self.kernel.tasks
        return {task: np.array(v, dtype=float) for task, v in found.items() if task in tasks}

    def _found(self, z: Array) -> dict[str, Any]:
        """The same of the kernel, in the middle of five elements."""
        w, r = self._directions(z)
        rest = self.any_neighbour(z)
        batch = np.array([rest, rest, z, rest, rest])
        X, data, _, dofs = np.split(batch, self.ends, axis=1)
        history = np.array([[float(v)] for v in self.meaning.history])
        given = {
            "data": data,
            "parameters": self.split(z)[2],
            "point_data": np.array([history] * 5),
        }
        k, at = self.kernel, self.ends[-1]
        v, design, unknowns = w[at:], np.tile(r[:at], (5, 1)), np.tile(r[at:], (5, 1))
        R, K = k.tangent(X, dofs, **given)
        self.arrays = [a[2] for a in (R, K) if np.isfinite(a[2]).all()]
        found: dict[str, Any] = {"residual": k.residual(X, dofs, **given)[2] @ v}
        np.testing.assert_allclose(R[2] @ v, found["residual"], atol=1e-10 * (1 + abs(R[2]).max()))
        found["tangent"] = v @ K[2] @ r[at:]
        if "product" in k.tasks:
            found["product"] = v @ k.product(X, dofs, unknowns, **given)[2]
        if "pseudo_load" in k.tasks:
            found["pseudo_load"] = v @ k.pseudo_load(X, dofs, design, **given)[2]
        if "d_k" in k.tasks:
            found["d_k"] = v @ k.derivative("k", X, dofs, **given)[2]
        found["fields"] = k.fields_at(X, dofs, **given)[2]
        if "fields_rate" in k.tasks:
            found["fields_rate"] = k.fields_rate(X, dofs, np.tile(r, (5, 1)), **given)[2]
        if "energy" in k.tasks:
            found["energy"] = k.energy(X, dofs, **given)[2]
        return found

    def any_neighbour(self, z: Array) -> Array:
        """Another element of the same cell, at rest."""
        found = z.copy()
        found[self.ends[-1] :] = 0.05
        return found


def _nodes(page: RandomPage) -> Array:
    """Places of the nodes; on facets of two cells, mirrored at the facet."""
    nodes: Array = CELLS[page.kind].nodes.astype(float)
    if not page.cell.endswith("_interior"):
        return nodes
    corners = FIRST[page.kind.rstrip("0123456789")]
    count = len(corners)
    turn = [corners[(1 - k) % count] for k in range(count)]
    # the affine map of cell b that takes its corner turn[k] to corner k of a, and the rest beyond
    b = nodes.copy()
    rows = [nodes[c] for c in turn] + [nodes.mean(axis=0)]
    facet = nodes[list(corners)]
    outwards = 2 * facet.mean(axis=0) - nodes.mean(axis=0)
    goals = [*facet, outwards]
    A = np.column_stack([np.array(rows), np.ones(len(rows))])
    b = np.column_stack([nodes, np.ones(len(nodes))]) @ np.linalg.lstsq(A, np.array(goals))[0]
    return np.vstack([nodes, b])


def defined(seed: int) -> tuple[RandomPage, Definition]:
    """The first page of a seed that has a definition, and values at most states."""
    for attempt in range(100):
        page = random_page(seed, attempt)
        try:
            d = page.definition()
        except (ModelError, TypeError, ValueError) as error:
            if not NOT_REAL.search(str(error)):
                raise
            continue  # SymPy has found numbers that are not real
        there = Comparison(d, Meaning(page, (), d.rule.rows()), random.Random(5))
        states = [there.any_state(kind) for kind in ("rest", "any", "any", "any", "any")]
        if sum(there.has_value(z) for z in states) > 3:
            return page, d
    raise AssertionError(f"no page of seed {seed}")


def comparisons(pages: Sequence[tuple[RandomPage, Definition]], folder: Path) -> list[Comparison]:
    """Kernels of pages in one library."""
    made = [pipeline.compile_model(d) for _, d in pages]
    for name, text in output_files.files(made).items():
        (folder / name).write_text(text, encoding="utf-8")
    build.build(folder, extra=(*build.STRICT, "-O1"))
    return [
        Comparison(load_kernel(d.name, folder), Meaning(page, (), d.rule.rows()), random.Random(7))
        for page, d in pages
    ]


def test_a_page_agrees_and_wrong_meanings_of_it_do_not(tmp_path: Path) -> None:
    page = RandomPage(
        "small",
        "line3",
        "solid",
        "point",
        ("*", ("s",), ("named", ("cosh",))),
        ((("*", ("T",), ("s",)), "S"),),
        "log",
        "cubic",
        (("*", ("S",), ("+", ("J",), ("b",))), ("q",)),
        ("s",),
        TASKS,
    )
    (right,) = comparisons([(page, page.definition())], tmp_path)
    z = next(z for kind, z in right.states() if kind == "any" and right.agrees(z))
    more = ("+", page.energy, ("*", ("number", sp.Rational(1, 10**6)), ("*", ("S",), ("S",))))
    for wrong in (
        replace(page, energy=more),
        replace(page, fluxes=(*page.fluxes, (("S",), "S"))),
        replace(page, local="ramp"),
        replace(page, history=("+", page.history, ("number", sp.Rational(1, 10**6)))),
        replace(page, stretches="coupled"),
    ):
        right.meaning.page = wrong
        with pytest.raises(AssertionError):
            right.agrees(z)
    right.meaning.page = page
    assert right.agrees(z)


@pytest.mark.slow
@pytest.mark.parametrize("first", range(0, PAGES, 4))
def test_random_pages_on_all_cells(tmp_path: Path, first: int) -> None:
    reached = Counter[str]()
    for c in comparisons([defined(k) for k in range(first, first + 4)], tmp_path):
        for kind, z in c.states():
            reached[kind] += c.agrees(z)
    assert reached["any"] >= 6, reached
    assert reached.total() > reached["any"], reached  # special states, too

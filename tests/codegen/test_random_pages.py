"""Random pages against what they mean: cells, branches, states far from rest, mistakes."""

from __future__ import annotations

import random
import re
import tempfile
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import mpmath
import numpy as np
import pytest
import sympy as sp
from hypothesis import HealthCheck, Phase, assume, given, settings
from hypothesis import strategies as st

from softehl.codegen import pipeline
from softehl.codegen.abi import Target
from softehl.codegen.elements import quadrature
from softehl.codegen.graph.evaluation import EvaluationState, Walk
from softehl.codegen.language.definition import Definition
from softehl.codegen.language.errors import ModelError
from softehl.codegen.language.model import Model
from softehl.codegen.tools import build, model_loader, output_files
from softehl.codegen.tools.model_text import ModelFileError
from softehl.runtime.arrays import Array
from softehl.runtime.kernels.kernel import load_kernel
from softehl.runtime.mesh.cells import CELLS
from tests.codegen.nested_models import (
    DIGITS,
    STEP,
    Nested,
    NoValueError,
    Tree,
    drawn,
)
from tests.codegen.random_models import UNKNOWNS, OutsideError, Recipe, expressions, recipes
from tests.codegen.random_pages import FIRST, TASKS, Meaning, RandomPage, moved, random_page
from tests.codegen.test_properties import error, expected

# --- Kernels of random pages of fields on all cells, against what the pages mean in many digits ---


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
    build.build(folder, extra=(*build.STRICT, "-O0"))
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


# --- Random pages: SymPy's derivatives through names are the model's; errors name their line ------


FUZZ = settings(
    derandomize=True,
    max_examples=30,
    database=None,
    deadline=None,
    phases=[Phase.generate],
    suppress_health_check=list(HealthCheck),
)
A, B = sp.symbols("a b", real=True)
AT = (0.37, -0.81, 1.23)


@given(
    expressions(UNKNOWNS, 4),
    expressions((*UNKNOWNS, A), 4),
    expressions((*UNKNOWNS, A, B), 5),
    st.sampled_from(["x", "y", "z", "a", "b"]),
)
@FUZZ
def test_sympy_and_the_model_differentiate_alike(a: Any, b: Any, w: Any, by: str) -> None:
    """Values of sp.diff(W, s) and m.derivative(W, s), for inputs and for names, in 50 digits."""
    m = Model("fuzz", nodes=1, rule=quadrature.point_rule())
    known: dict[Any, Any] = {u: m.unknown(str(u)) for u in UNKNOWNS}
    for symbol, value in ((A, a + UNKNOWNS[0] / 3), (B, b + A * UNKNOWNS[1])):
        known[symbol] = m.define(str(symbol), value.xreplace(known))
    W = (w + A * B).xreplace(known)
    s = next(v for k, v in known.items() if str(k) == by)
    try:
        theirs = m._lower(sp.diff(W, s))
    except ModelError as error:  # SymPy's |log y|' holds imaginary parts
        assume("real numbers" not in str(error))
        raise
    ours = m._lower(m.derivative("slope", W, s))
    with mpmath.workdps(50):
        walk = Walk(EvaluationState((), AT), {})
        try:
            found, expected = walk.value(theirs), walk.value(ours)
            smooth = abs(found) < 1e30
        except (ArithmeticError, ValueError, TypeError):
            smooth = False  # no real value there
        assume(smooth)
        assert abs(found - expected) <= mpmath.mpf(10) ** -30 * (1 + abs(expected))


PAGE = """
import sympy as sp
from softehl import Definition, Model, quadrature

def page() -> Definition:
    m = Model("page", nodes=1, rule=quadrature.gauss(2, 1))
    u, v = m.unknown("u"), m.unknown("v")
    (k,) = m.parameters(k="stiffness")
    a = m.define("a", u**2 + v)
    s = m.implicit("s", lambda s: s**3 + s - a, start=u)
    m.potential(m.integral("Pi", k * a**2 + s * u))
    return m.finish()
"""
LEGAL = ("u**2 + v", "s**3 + s - a", "k * a**2 + s * u", "start=u", '"a"', '"page"', "2, 1", "k=")
WRONG = (
    *(
        "1 / 0",
        "sp.oo",
        "0.1 * u",
        "w",
        "sp.gamma(u)",
        "sp.I * u",
        "u if u > 0 else v",
        "1 / (u - u)",
    ),
    *("sp.Matrix([u, v])", "sp.diff(s, u)", "sp.Piecewise((u, u > 0))", "'text +'", "None", "[u]"),
    *(
        '"a b"',
        '""',
        "sp.Symbol('a', real=True)",
        "sp.Derivative(u**2, u)",
        "0, 1",
        "2, 9",
        "'x', 1",
    ),
    *("sp.nan", "s.subs(u, 1)", "lambda: u", "u.missing", "u +* v", "m.unknown('u')"),
)


@given(st.sampled_from(LEGAL), st.sampled_from(WRONG))
@FUZZ
def test_a_page_is_right_or_an_error_with_its_line(
    tmp_path_factory: pytest.TempPathFactory, legal: str, wrong: str
) -> None:
    """One part of a page replaced by something strange: no error but ours, and it names a line."""
    path: Path = tmp_path_factory.mktemp("fuzz") / "page.py"
    path.write_text(PAGE.replace(legal, wrong, 1))
    message = ""
    try:
        (d,) = model_loader.definitions(path)
        assert d.name
    except ModelFileError as error:
        message = str(error)
    assert not message or re.fullmatch(r"\S*page\.py:\d+: .+", message), message


# --- Sides of nested branches that are not chosen: nothing of them reaches a result, in any -------


Q = sp.Rational
T, x = ("T",), ("x",)
ROOT = ("sqrt", T)
NAMED = ("named", ROOT)


def number(a: int, b: int) -> Tree:
    return ("number", Q(a, b))


def either(a: Tree, b: Tree, then: Tree, otherwise: Tree) -> Tree:
    """`then` where a < b."""
    return ("pieces", a, b, then, otherwise, True)


_LOGARITHM = ("log", ("+", number(1, 7), ("*", T, T)))
_LOW = either(number(1, 5), T, ROOT, _LOGARITHM)
_MIDDLE = either(_LOW, x, _LOW, ("*", x, x))
TREES = {
    "three_deep": either(_MIDDLE, T, _MIDDLE, ("*", T, x)),
    "name_in_two": (
        "+",
        either(number(1, 5), x, ("*", NAMED, x), ("*", x, x)),
        either(number(3, 10), x, ("*", NAMED, ("*", x, x)), x),
    ),
    "each_point": either(number(1, 5), x, ("*", ROOT, x), x),
    "one_over": (
        "+",
        either(number(1, 5), x, ("*", ("named", ("1/", ("max", T, number(0, 1)))), x), x),
        either(x, number(0, 1), ("log", ("max", T, number(0, 1))), x),
    ),
}


def compiled(models: Sequence[Nested], target: Target, folder: Path) -> None:
    """All kernels of some models in one library."""
    made = [pipeline.compile_model(m.definition(), target) for m in models]
    for name, text in output_files.files(made).items():
        (folder / name).write_text(text, encoding="utf-8")
    build.build(folder, extra=(*build.STRICT, "-O0"))


def checked(model: Nested, folder: Path, seed: int, states: int = 8) -> int:
    """Compare all tasks at random states; the number of states with a value."""
    kernel, rng, done = load_kernel(model.name, folder), random.Random(seed), 0
    for _ in range(60):
        dofs, k = [rng.uniform(-1.5, 1.5) for _ in range(3)], rng.uniform(-1, 1)
        try:
            expected = model.tangent(dofs, k)
        except NoValueError:
            continue
        R, K = (np.array(v, dtype=float) for v in expected)
        scale = max(1.0, abs(R).max(), abs(K).max())
        batch = np.array([[0.1, 0.2, 0.3], [1.2, 0.8, 0.9], dofs, [0.1, 0.2, 0.3], [1.2, 0.8, 0.9]])
        nowhere, given = np.empty((5, 0)), {"parameters": [k]}
        along, w = np.ones((5, 1)), np.array([0.3, -0.7, 0.4])
        residual, tangent = kernel.tangent(nowhere, batch, **given)
        for found, right in (
            (residual, R),
            (tangent, K[:, :3]),
            (kernel.product(nowhere, batch, np.tile(w, (5, 1)), **given), K[:, :3] @ w),
            (kernel.derivative("k", nowhere, batch, **given), K[:, 3]),
            (kernel.pseudo_load(nowhere, batch, along, **given), K[:, 3]),
        ):
            np.testing.assert_allclose(found[2], right, rtol=0, atol=1e-8 * scale)
        done += 1
        if done == states:
            break
    return done


def test_nothing_of_a_side_that_is_not_chosen_reaches_a_task(tmp_path: Path) -> None:
    models = [Nested(name, tree) for name, tree in TREES.items()]
    compiled(models, Target.SIMD, tmp_path)
    for m in models:
        assert checked(m, tmp_path, seed=1, states=20) > 5, m.name


@pytest.mark.slow
@pytest.mark.parametrize("target", [Target.SIMD, Target.SCALAR])
def test_random_branches_in_branches(tmp_path: Path, target: Target) -> None:
    models = []
    for seed in range(80):
        m = Nested(f"drawn_{seed}", drawn(random.Random(seed), 4))
        try:
            m.definition()
        except (ModelError, TypeError, ValueError):  # SymPy has found numbers that are not real
            continue
        models.append(m)
    compiled(models, target, tmp_path)
    assert sum(checked(m, tmp_path, seed) for seed, m in enumerate(models)) > 200


# --- 200 random pages far from rest: C against 50 digits at unknowns from 1e-3 to 1e3 -------------


WIDE_PAGES = 200
STATES = 6
HUGE = 1e150
"""No value above: its square is still a double."""


def wide_recipes(count: int) -> list[Recipe]:
    found: list[Recipe] = []

    @settings(
        derandomize=True,
        max_examples=count,
        database=None,
        deadline=None,
        phases=[Phase.generate],
        suppress_health_check=list(HealthCheck),
    )
    @given(recipes(wide=True))
    def collect(recipe: Recipe) -> None:
        found.append(recipe)

    collect()
    return found


def wide_states(seed: int) -> list[tuple[float, ...]]:
    rng = random.Random(seed)
    return [
        tuple(rng.choice((-1, 1)) * 10 ** rng.uniform(-3, 3) for _ in range(4))
        for _ in range(STATES)
    ]


@pytest.mark.slow
def test_random_pages_are_right_far_from_rest() -> None:
    folder = Path(tempfile.mkdtemp(prefix="wide_states_"))
    pages = {f"wide_{k}": recipe for k, recipe in enumerate(wide_recipes(WIDE_PAGES))}
    models = [recipe.definition(name) for name, recipe in pages.items()]
    for name, text in output_files.files([pipeline.compile_model(d) for d in models]).items():
        (folder / name).write_text(text, encoding="utf-8")
    build.build(folder, extra=(*build.STRICT, "-O0"))
    wrong, compared, overflows = {}, 0, 0
    for k, (name, recipe) in enumerate(pages.items()):
        kernel = load_kernel(name, folder)
        for state in wide_states(k):
            try:
                exact = expected(recipe, state)
            except (OutsideError, ZeroDivisionError, OverflowError):
                continue
            if any(not abs(v) + b < HUGE for pairs in exact.values() for v, b in pairs):
                continue
            off = error(kernel, {"state": state, **exact})
            compared += 1
            overflows += not np.isfinite(off)
            if np.isfinite(off) and off > 1e-10:
                wrong[name, state] = off
    print(f"{len(pages)} pages, {compared} states compared, {overflows} not-a-number in C")
    assert wrong == {}
    assert compared > WIDE_PAGES
    assert overflows < compared / 50

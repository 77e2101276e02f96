"""Sides of nested branches that are not chosen: nothing of them reaches a result, in any task."""

from __future__ import annotations

import random
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest
import sympy as sp

from softehl.codegen import pipeline
from softehl.codegen.abi import Target
from softehl.codegen.language.errors import ModelError
from softehl.codegen.tools import build, output_files
from softehl.runtime.kernels.kernel import load_kernel
from tests.codegen.nested_models import (
    Nested,
    NoValueError,
    Tree,
    drawn,
)

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
    build.build(folder, extra=(*build.STRICT, "-O1"))


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

"""200 random pages far from rest: C against 50 digits at unknowns from 1e-3 to 1e3.

The pages hold what looks constant near rest: saturated and inverse functions, branches far away.
A state counts where the page has a real value that a double holds; there the C has it too, to
1e-10 of the rounding that the formula as it was written may commit, or says not-a-number (an
exponential that overflows on the way).
"""

from __future__ import annotations

import random
import tempfile
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, Phase, given, settings

from softehl.codegen import pipeline
from softehl.codegen.tools import build, output_files
from softehl.runtime.kernels.kernel import load_kernel
from tests.codegen.random_models import OutsideError, Recipe, recipes
from tests.codegen.test_properties import error, expected

PAGES = 200
STATES = 6
HUGE = 1e150
"""No value above: its square is still a double."""
EPSILON = 2.0**-52


def drawn(count: int) -> list[Recipe]:
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
    pages = {f"wide_{k}": recipe for k, recipe in enumerate(drawn(PAGES))}
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
    assert compared > PAGES
    assert overflows < compared / 50

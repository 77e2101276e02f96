"""`docs/language.md`: its examples run, compile and are right; it names what there is."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from softehl import initial_weights
from softehl.codegen.language.definition import Definition
from softehl.codegen.language.model import Model
from softehl.codegen.language.sympy_lowering import SUPPORTED
from softehl.runtime.kernels.kernel import Kernel
from tests.codegen.workshop import compiled, tangent_errors

PAGE = (Path(__file__).parents[2] / "docs" / "language.md").read_text(encoding="utf-8")
BLOCKS = re.findall(r"```python\n(.*?)```", PAGE, re.DOTALL)
SQUARE = [-0.5, -0.5, 0.5, -0.5, 0.5, 0.5, -0.5, 0.5]
MOVED = [0.1, 0.05, 0.2, -0.1, 0.15, 0.1, -0.05, 0.2]
CALLS: dict[str, tuple[list[float], list[float], dict[str, Any]]] = {
    "definition": (SQUARE, MOVED, {"parameters": [1.0, 2.0]}),
    "stop": ([], [1.5], {"parameters": [3.0, 1.0]}),
    "creep": (
        [0.0, 2.0],
        [0.0, 0.3],
        {"parameters": [2.0, 0.7, 0.5], "point_data": np.array([[0.02]])},
    ),
    "condensed": ([0.0, 2.0], [0.0, 0.3], {"parameters": [2.0]}),
    "spring_of_data": ([], [1.3], {"parameters": {"energy": ([0, 1, 2, 3], [0, 1, 5, 9])}}),
    "learned_spring": ([], [0.3], {"parameters": {"W": initial_weights(2, (4, 3), seed=1)}}),
    "prony_bar": (
        [0.0, 2.0],
        [0.0, 0.3],
        {
            "parameters": {"E": 2.0, "dt": 0.1, "g": [0.4, 0.3], "tau": [0.2, 1.0]},
            "data": [0.0, 0.1],
            "point_data": np.array([[0.02, -0.01]]),
        },
    ),
    "fibres": ([], [0.3], {"parameters": {"k": [3.0, 1.0, 2.0], "crimp": [0.0, 0.1, 0.4]}}),
    "damaged_spring": ([], [0.7], {"parameters": [1.3]}),
    "ogden_series": (SQUARE, MOVED, {"parameters": {"mu": [1.0, 0.4], "alpha": [1.7, -2.0]}}),
    "ogden": (SQUARE, MOVED, {"parameters": [1.0, 1.7]}),
    "hencky_hill": (SQUARE, MOVED, {"parameters": [1.0, 0.7, 0.4]}),
    "torsion_spring": ([], [0.2, -0.1, 0.3], {"parameters": [1.3]}),
}


@pytest.fixture(scope="module")
def names() -> dict[str, Any]:
    found: dict[str, Any] = {}
    for block in BLOCKS:
        exec(compile(block, "docs/language.md", "exec"), found)
    return found


def test_every_model_of_the_page_is_called(names: dict[str, Any]) -> None:
    assert {k for k, v in names.items() if isinstance(v, Definition)} == set(CALLS)


@pytest.mark.parametrize("name", CALLS)
def test_examples_against_the_oracle(name: str, names: dict[str, Any], tmp_path: Path) -> None:
    X, u, given = CALLS[name]
    kernel: Kernel = compiled(names[name], tmp_path, "-O0")
    assert max(tangent_errors(names[name], kernel, X, u, **given)) <= 1e-14
    if name == "ogden":
        assert kernel.tasks == ("residual", "tangent", "product", "d_alpha", "d_X3")


def test_the_page_names_everything() -> None:
    said = set(re.findall(r"`(?:\w+(?:, \w+)* = )?m\.(\w+)", PAGE))
    there = {n for n in dir(Model) if not n.startswith("_")}
    assert there <= said | {"doc"}
    functions = set(re.findall(r"\w+", SUPPORTED))
    assert functions <= set(re.findall(r"\w+", PAGE))

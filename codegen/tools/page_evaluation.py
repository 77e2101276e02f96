"""Evaluation of the page of a kernel at the state of one element, for the runtime.

`softehl.runtime.kernels.explanation` has the record of the state.
"""

from __future__ import annotations

from functools import cache
from pathlib import Path
from typing import Any

from softehl.codegen.graph.evaluation import EvaluationState
from softehl.codegen.language.definition import Definition
from softehl.codegen.tools import kernel_cache
from softehl.codegen.tools.model_text import ModelFileError
from softehl.codegen.verify.explanation import explain

SHIPPED = Path(__file__).resolve().parents[2] / "generated"


def evaluate(
    folder: Path, kernel: str, state: Any
) -> tuple[list[tuple[str, tuple[float, ...], str]], str]:
    """Name, values at the points and line of each named value of a kernel, and the fault.

    Raises `ModelFileError` where the page is not known to this process.
    """
    explained = explain(
        definition_of(folder, kernel),
        EvaluationState(
            coordinates=state.coordinates.tolist(),
            dofs=state.dofs.tolist(),
            data=state.data.tolist(),
            parameters=state.parameters.tolist(),
            rule=state.rule.tolist(),
            basis=state.basis.tolist(),
            point_data=state.point_data.tolist(),
            arrays=[a.tolist() for a in state.arrays],
            term_history=[[a.tolist() for a in row] for row in state.term_history],
        ),
    )
    return [(v.name, v.values, v.where) for v in explained.values], explained.fault


@cache
def definition_of(folder: Path, kernel: str) -> Definition:
    """The model of a kernel of a library.  Raises `ModelFileError` where it is not known."""
    if folder == SHIPPED:
        from softehl.codegen.models import ALL

        return ALL[kernel]()
    definition = kernel_cache.definition_of(folder, kernel)
    if definition is None:
        raise ModelFileError(
            f"the page of {kernel} is not known to this process: load its model file or its page, "
            f"not {folder}"
        )
    return definition

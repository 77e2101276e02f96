"""Explanation of an element of a study: named values of its page at a state."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

from softehl.errors import UnknownNameError
from softehl.runtime.arrays import Array
from softehl.runtime.definition.problem_definition import Block, StudyError
from softehl.runtime.discretisation.problem import Problem
from softehl.runtime.kernels.explanation import Explanation
from softehl.runtime.suggestions import did_you_mean, join_names

if TYPE_CHECKING:
    from softehl.runtime.equations.system import System


def explain_element(
    system: System, problem: Problem, x: Array, element: int, block: str | None
) -> Explanation:
    """Named values of the page in an element; block None: the only one.

    Raises UnknownNameError, StudyError, ArgumentError for an element that is not there.
    """
    if system.whole is not None:
        raise StudyError("explain: the mesh is distributed: explain it with one process")
    names = list(system.blocks)
    if block is None and len(names) > 1:
        raise StudyError(f"explain: say in which block, block=...: {join_names(names)}")
    name = names[0] if block is None else block
    block_called(system.blocks, name)
    return problem.assembler.block(name).explain(x, problem.parameters[name], element)


def block_called(blocks: Mapping[str, Block], name: str) -> Block:
    """The block of a name.  Raises UnknownNameError, a KeyError, that names what there is."""
    if name not in blocks:
        raise UnknownNameError(
            f"no block {name!r}{did_you_mean(name, blocks)}; there are {join_names(blocks)}"
        )
    return blocks[name]


def explain_at(
    system: System, element: int, block: str | None, t: float, x: Array | None
) -> Explanation:
    """As `explain_element`, at a load factor; x None: initial unknowns, with prescribed values."""
    start = system.at_rest()
    problem = system.problem(system.quasi_static_step(t, start, system.histories()))
    if x is None:
        x = start.copy()
        x[problem.fixed] = problem.values
    elif x.shape != start.shape:
        raise StudyError(f"explain: x has shape {x.shape}, must be {start.shape}")
    return explain_element(system, problem, x, element, block)

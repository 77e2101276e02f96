"""Local unknowns of a model, solved for inside the kernel, and energies of principal stretches."""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass
from typing import Any

import sympy as sp

from softehl.codegen.elements.quadrature import QuadratureRule
from softehl.codegen.graph.evaluation import symmetric
from softehl.codegen.graph.graph import Graph, InputEntry, Node, Op
from softehl.codegen.graph.routines import (
    Control,
    External,
    Isotropic,
    depends,
    isotropic,
    localise,
    newton,
    unroll_sums,
)
from softehl.codegen.graph.traversal import reachable
from softehl.codegen.language.errors import ModelError
from softehl.codegen.language.flatten import Entries, call_function, fraction
from softehl.codegen.language.named_symbols import placeholders
from softehl.codegen.language.sympy_lowering import Symbols
from softehl.codegen.language.tensor_functions import symmetric_entries


@dataclass(frozen=True)
class Iteration:
    """Settings of a local Newton iteration as a model gives them (`Model.implicit`)."""

    tolerance: float
    size: float
    iterations: int

    def control(self, name: str) -> Control:
        """The settings, exact and checked."""
        count = self.iterations
        if not (isinstance(count, int) and count > 0):
            raise ModelError(f"{name}: iterations = {count!r} must be an integer > 0")
        return Control(fraction(self.tolerance), fraction(self.size, zero=True), count)


def implicit(
    symbols: Symbols,
    name: str,
    equations: Callable[[Any], Any],
    start: Any,
    iteration: Iteration,
    condensed: Callable[[list[Node], list[Node]], list[Node]],
) -> Any:
    """Names of the solution of equations = 0, arranged like `start`.

    condensed: of the equations and the unknowns, the equations without integrals.
    """
    begin = Entries.of(start)
    unknowns = Entries(placeholders(len(begin.values), real=True), begin.suffixes, begin.arrange)
    local = symbols.placeholders(name, unknowns)
    residuals = Entries.of(call_function(name, equations, unknowns.shaped()))
    if len(residuals.values) != len(local):
        raise ModelError(
            f"{name}: {len(residuals.values)} equations for {len(local)} unknowns; one for each"
        )
    values = condensed([symbols.lower(e) for e in residuals.values], local)
    system = localise(symbols.graph, values, local)
    routine = newton(symbols.graph, name, system, iteration.control(name))
    for k in range(len(local)):
        if all(row[k] is symbols.graph.zero for row in routine.by_local):
            raise ModelError(f"{name}: unknown {k} does not occur in the equations")
    args = [*system.external, *(symbols.lower(e) for e in begin.values)]
    below = [*residuals.values, *begin.values]
    solution = symbols.named(name, begin, symbols.graph.run(routine, args), below)
    symbols.record.implicit(
        residuals.values, unknowns.values, begin.values, Entries.of(solution).values
    )
    return solution


def contain_integrals(values: Sequence[Node], unknowns: Sequence[Node]) -> bool:
    """True if integrals of the unknowns are among the equations."""
    return any(n.op is Op.SUM for n in depends(values, unknowns))


def written_out(
    graph: Graph,
    name: str,
    values: list[Node],
    unknowns: Sequence[Node],
    prescribed: Collection[Node],
    rule: QuadratureRule,
) -> list[Node]:
    """Equations with integrals of the unknowns as sums of one term for each point.

    prescribed: values whose derivatives a model gives.
    """
    inside = depends(values, unknowns)
    if any(v.varying for v in values):
        raise ModelError(
            f"{name}: an equation varies with the point and another holds an integral of the "
            "unknowns; wrap it in integral(...) too"
        )
    below = reachable([n for n in inside if n.op is Op.SUM])
    arrays = {n.payload.array for n in below if isinstance(n.payload, InputEntry) and n.varying}
    if arrays - {"rule"} or any(n in prescribed for n in below):
        raise ModelError(
            f"{name}: an integral of local unknowns may hold no point data, no interpolated "
            "field and no given derivative; use m.unknown for what the element condenses"
        )
    return unroll_sums(graph, values, inside, rule.rows())


def principal(
    symbols: Symbols, name: str, C: Any, energy: Callable[[Any, Any, Any], Any] | None
) -> sp.Symbol:
    """Name of an isotropic energy of the roots of the eigenvalues of C."""
    if energy is None or not callable(energy):
        raise ModelError(
            f"{name}: write m.principal({name!r}, C, lambda a, b, c: ...), e.g. with C = F.T * F"
        )
    _, entries = symmetric_entries(symbols, name, C, (3,))
    squares = Entries(placeholders(3, positive=True), ("", "", ""), list)
    local = symbols.placeholders(name, squares)
    written = call_function(name, energy, *(sp.sqrt(c) for c in squares.values))
    value = symbols.lower(written)
    if any(isinstance(n.payload, Isotropic) for n in depends([value], local)):
        raise ModelError(f"{name}: its energy holds an energy of other stretches; add them outside")
    if any(isinstance(n.payload, External) for n in depends([value], local)):
        raise ModelError(
            f"{name}: its energy calls a C function of the stretches, which has no divided "
            "differences: call it with invariants of C"
        )
    if not symmetric(value, local):
        raise ModelError(f"{name}: the energy changes when two stretches are exchanged")
    system = localise(symbols.graph, [value], local)
    routine = isotropic(name, 6 + len(system.external), system.values[0])
    args = [*entries, *system.external]
    node = symbols.graph.name(name, symbols.graph.run(routine, args)[0])
    symbol: sp.Symbol = symbols.record.principal(
        symbols.name(name, node, [*C, written], has_definition=False), written, squares.values, C
    )
    return symbol

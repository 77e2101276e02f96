"""A model in the making: its parts, and the definition that they become.

`Symbols` say what stands for which node of the graph, `Arguments` what is declared,
`Intermediates` and `local` name values, `Equations` make the residual, `Outputs` are what is
evaluated and generated. Each knows the symbols and no other part.
"""

from __future__ import annotations

import re

from softehl.codegen.graph.graph import Node
from softehl.codegen.graph.traverse import reachable
from softehl.codegen.language import local, outputs
from softehl.codegen.language.arguments import Arguments
from softehl.codegen.language.complaints import ModelError
from softehl.codegen.language.definition import Definition
from softehl.codegen.language.elements import cells
from softehl.codegen.language.elements.quadrature import QuadratureRule
from softehl.codegen.language.equations import Equations
from softehl.codegen.language.intermediates import Intermediates
from softehl.codegen.language.outputs import Outputs
from softehl.codegen.language.symbols import Symbols

NAME = re.compile(r"[A-Za-z][A-Za-z0-9_]*")
"""What a model may be called: it is part of the names of C functions."""
LONGEST = 200
"""Letters of the name of a model: file systems take 255, with `_design.c` and the like."""


class Draft:
    """Owner of the parts of a model; `Model` adds what a page may say."""

    _unused = 'its residual is zero; if that is meant, say idle=["..."] in m.nodal_unknowns'

    def __init__(
        self,
        name: str,
        *,
        nodes: int,
        rule: QuadratureRule | None = None,
        unroll: bool | None = None,
        doc: str | None = "",
    ) -> None:
        if not NAME.fullmatch(name):
            raise ModelError(
                f"a model is called {name!r}; use letters, digits and underscores, a letter first"
            )
        if len(name) > LONGEST:
            raise ModelError(
                f"the name {name[:20]}... of a model has {len(name)} letters, allowed are {LONGEST}"
            )
        if rule is None:
            raise ModelError(
                f"{name} has no rule: give rule=quadrature.gauss(2, 2), say, or "
                "rule=quadrature.point_rule() where there is no integral"
            )
        wrong = self._foreign(rule, nodes)
        if wrong:
            raise ModelError(f"{name} has {nodes} nodes, and {wrong}")
        self.name, self.nodes, self.rule, self.unroll = name, nodes, rule, unroll
        self.doc = " ".join((doc or "").split())
        self._symbols = Symbols(name)
        self.graph, self._lower = self._symbols.graph, self._symbols.lower
        self._arguments = Arguments(self._symbols, nodes)
        self._intermediates = Intermediates(self._symbols)
        self._equations = Equations(self._symbols)
        self._outputs = Outputs(self._symbols)

    def _foreign(self, rule: QuadratureRule, nodes: int) -> str:
        """Words on a rule of another cell than that of the nodes."""
        return cells.foreign(rule, nodes)

    def finish(self) -> Definition:
        """Return the definition of the model.

        Returns
        -------
        Definition
            The model, for `softehl.load_kernel` and `Study.add`.

        Raises
        ------
        ModelError
            The model has no residual, or declares something that it does not use.
        """
        potential, constant = self._equations.total()
        self._check_use(potential)
        a, o = self._arguments, self._outputs
        definition = Definition(
            name=self.name,
            doc=self.doc,
            nodes=self.nodes,
            coordinates=a.coordinates,
            unknowns=tuple(a.unknowns),
            interpolated=a.interpolated,
            parameters=tuple(a.lists["parameters"]),
            data=tuple(a.lists["data"]),
            point_data=tuple(a.lists["point data"]),
            rule=self.rule,
            unroll=self.unroll,
            graph=self.graph,
            potential=potential,
            constant=constant,
            given=self._intermediates.given,
            directions=tuple(a.directions),
            interface=tuple(self._intermediates.interface),
            fields=o.evaluated,
            product=o.product,
            pseudo_load=o.pseudo_load,
            fields_rate=o.fields_rate,
            derivatives=tuple(o.derivatives),
            example=tuple(a.example.items()),
            tasks=o.tasks,
            conditions=tuple(a.conditions),
            nodal=tuple(a.nodal),
            components=a.components or 2,
            places=tuple(a.places),
            history=tuple(name for name, _ in o.history),
            internal=tuple(a.internal),
            record=self._symbols.record,
        )
        outputs.check(definition)
        return definition

    def _check_use(self, potential: Node) -> None:
        """Every unknown enters the potential, every other argument it or a field."""
        given = [
            n for pairs in self._intermediates.given.values() for n in (*pairs, *pairs.values())
        ]
        equations = set(reachable([potential, *given]))
        used = equations | set(reachable([n for _, n in self._outputs.evaluated]))
        self._arguments.check_use(equations, used, self._unused)

    def _condensed(self, name: str, values: list[Node], unknowns: list[Node]) -> list[Node]:
        """Equations of local unknowns; integrals of these, and with them the loop, written out."""
        if not local.hold_integrals(values, unknowns):
            return values
        if self.unroll is False:
            raise ModelError(f"{name}: its equations are integrals, which need unroll=True or None")
        given = self._intermediates.given
        written = local.written_out(self.graph, name, values, unknowns, given, self.rule)
        self.unroll = True
        return written

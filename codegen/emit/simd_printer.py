"""Values of several elements at once as lines of C: one vector, one lane per element.

A value that depends on parameters, the rule and the basis alone is the same in all lanes and
stays a scalar.  A branch is computed where some lane wants it and blended by bits, so that nothing
of the side that a lane does not take, not-a-number included, gets into it; where all lanes agree
the other side is skipped.
"""

from __future__ import annotations

from collections.abc import Sequence

from softehl.codegen import abi
from softehl.codegen.emit.c_printer import Printer, array_operands, number
from softehl.codegen.emit.code_motion import If, Same, Statement
from softehl.codegen.graph.graph import BOOLEAN, ELEMENTARY, FREE, InputEntry, Node, Op, Routine
from softehl.codegen.graph.term_reductions import Kind, Reduction
from softehl.codegen.graph.traversal import reachable
from softehl.codegen.language.definition import Definition

FUNCTIONS = frozenset({Op.SQRT, Op.CBRT, Op.RCBRT, Op.LOG, Op.EXP, Op.SIN, Op.COS}) | ELEMENTARY
_SAME = ("parameters", "rule", "arrays", "term history")
_LETTERS = {
    "coordinates": "X",
    "dofs": "d",
    "data": "a",
    "direction": "t",
    "point data": "b",
    "interpolated": "p",
    "interpolated direction": "tp",
}
_MASKS = {
    Op.LT: "softehl_lt({}, {})",
    Op.LE: "softehl_le({}, {})",
    Op.EQ: "softehl_eq({}, {})",
    Op.AND: "{} & {}",
    Op.OR: "{} | {}",
    Op.NOT: "~{}",
}
_OF_TWO = frozenset({Op.ATAN2, Op.POWER})
_IN_HEADER = frozenset({Op.SQRT, Op.CBRT, Op.RCBRT, Op.LOG, Op.EXP, Op.SIN, Op.COS, Op.POWER})


def wrappers(text: str) -> list[str]:
    """Functions of vectors that `text` calls and that the header does not have."""
    kinds = {False: "SOFTEHL_LANEWISE({})\n", True: "SOFTEHL_LANEWISE2({})\n"}
    needed = [op for op in sorted((FUNCTIONS | _OF_TWO) - _IN_HEADER) if f"softehl_v{op}(" in text]
    return [kinds[op in _OF_TWO].format(op) for op in needed]


class LanePrinter(Printer):
    """Printer of vectors of lanes and of scalars, under the mask of active lanes.

    `active` is the mask of these lanes inside a side of a branch; empty where all do.
    """

    kind, zero, output = "V", "softehl_splat(0.0)", "{}_lanes"

    def __init__(self, definition: Definition, active: str = "") -> None:
        super().__init__(definition)
        self.active = active
        self.scalar: dict[Node, bool] = {}

    def is_scalar(self, n: Node) -> bool:
        """True when all lanes hold the same value."""
        if n not in self.scalar:
            for m in reachable([n], stop=self.scalar.__contains__):
                if isinstance(m.payload, InputEntry):
                    self.scalar[m] = m.payload.array in _SAME
                elif m not in self.scalar:
                    self.scalar[m] = m.op is not Op.CALL and all(self.scalar[a] for a in m.args)
        return self.scalar[n]

    def ref(self, n: Node) -> str:
        if isinstance(n.payload, InputEntry) and n.payload.array in _LETTERS:
            return _LETTERS[n.payload.array] + str(n.payload.index)
        return super().ref(n)

    def value(self, n: Node) -> str:
        """Reference that is a vector in any case."""
        return f"softehl_splat({self.bare(n)})" if self.is_scalar(n) else self.bare(n)

    def same(self, s: Same) -> str:
        return self.ref(s.new) if self.is_scalar(s.old) else self.value(s.new)

    def mask(self, n: Node) -> str:
        """Reference to a condition that is a mask in any case."""
        return f"softehl_mask({self.ref(n)})" if self.is_scalar(n) else self.ref(n)

    def type_of(self, n: Node) -> str:
        return "double" if self.is_scalar(n) else self.kind

    def statement(self, depth: int, s: Node) -> None:
        if self.is_scalar(s):
            super().statement(depth, s)
        elif s.op in BOOLEAN:
            show = self.mask if s.op in (Op.AND, Op.OR, Op.NOT) else self.value
            right = _MASKS[s.op].format(*(show(a) for a in s.args))
            self.line(depth, f"const M {self.fresh(s)} = {right};")
        else:
            right = self.expression(s)
            if self.hides(s, right):
                return
            self.line(depth, f"const V {self.fresh(s)} = {right};")
            if s.op is Op.ITEM:  # what a routine writes elsewhere has a result that nobody reads
                routine = s.args[0].payload
                if isinstance(routine, Reduction) and routine.kind is Kind.EACH:
                    self.line(depth, f"(void){self.ref(s)};")

    def expression(self, n: Node) -> str:
        if not self.is_scalar(n):
            if n.op in FUNCTIONS:
                return f"softehl_v{n.op}({self.bare(n.args[0])})"
            if n.op in _OF_TWO:
                return f"softehl_v{n.op}({', '.join(map(self.value, n.args))})"
            if n.op is Op.POW:
                return f"softehl_vpow({self.bare(n.args[0])}, {number(float(n.payload))})"  # type: ignore[arg-type]
        return super().expression(n)

    def call(self, depth: int, n: Node, routine: Routine) -> None:
        """Run a routine for the lanes that want it; lanes in which it fails are remembered."""
        operands = ", ".join(map(self.value, n.args)) or self.zero
        name = f"{abi.PREFIX}_{self.d.name}_{routine.name}_lanes"
        mask = self.active or "softehl_mask(1)"
        self.line(depth, f"V {self.fresh(n)}[{routine.outputs}];")
        arrays = array_operands(self.d, self.terms)
        self.line(
            depth, f"{name}({mask}, {arrays}(const V[]){{{operands}}}, {self.ref(n)}, &failed);"
        )

    def branch(self, depth: int, s: If) -> None:
        if self.is_scalar(s.condition):
            super().branch(depth, s)
            return
        condition = self.ref(s.condition)
        names = [self.fresh(n) for n in s.merged]
        if not s.then and not s.otherwise:
            for n, name in zip(s.merged, names, strict=True):
                a, b = (self.value(x) for x in n.args[1:])
                self.line(depth, f"const V {name} = softehl_blend({condition}, {a}, {b});")
            return
        constant_side = {
            n: next((k for k in (2, 1) if self._is_constant(n.args[k])), 0) for n in s.merged
        }
        for n, name in zip(s.merged, names, strict=True):
            start = self.value(n.args[constant_side[n]]) if constant_side[n] else self.zero
            self.line(depth, f"V {name} = {start};")
        for k, sign, inner in ((1, "", s.then), (2, "~", s.otherwise)):
            assigned = [n for n in s.merged if constant_side[n] != k]
            if assigned:
                self._side(depth, assigned, k, f"{sign}{condition}", inner)

    def _is_constant(self, n: Node) -> bool:
        """True for a value that stands before what is printed next."""
        return n.op in FREE or n in self.names or n in self.inside

    def _side(
        self, depth: int, assigned: Sequence[Node], k: int, mask: str, inner: Sequence[Statement]
    ) -> None:
        """Print one side of a branch for the lanes of its mask; the others keep their values."""
        outer = self.active
        self.temporaries += 1
        self.active = f"m{self.temporaries}"
        both = f"{mask} & {outer}" if outer else mask
        self.line(depth, f"const M {self.active} = {both};")
        self.line(depth, f"if (softehl_any({self.active})) {{")
        self.block(depth + 1, inner)
        for n in assigned:
            name, value = self.names[n], self.value(n.args[k])
            blend = f"softehl_blend({self.active}, {value}, {name})"
            self.line(depth + 1, f"{name} = {blend};")
        self.line(depth, "}")
        self.active = outer

"""Printer of scheduled values as lines of C.  Nothing is optimised here.

A value that is used once is printed inside the line that uses it. Short statements stand side by
side in lines of one width.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from itertools import groupby

from softehl.codegen import abi
from softehl.codegen.emit.code_motion import If, Same, Schedule, Statement, flat
from softehl.codegen.graph.graph import (
    BOOLEAN,
    ELEMENTARY,
    InputEntry,
    Node,
    Op,
    ResultIndex,
    Routine,
)
from softehl.codegen.language.definition import Definition

WIDTH = 100
_DECLARED = re.compile(r"((?:const )?(?:V|M|double|int)) (\w.*);")
_KEPT = re.compile(r"(?:for|if|while|return|else|#|/|\*|\}|static|typedef)")


def filled(lines: Iterable[str]) -> list[str]:
    """Statements in filled lines: neighbours of one depth share them, declarations share a type."""
    out: list[str] = []
    split = [line for text in lines for line in text.split("\n")]
    for depth, group in groupby(split, _depth):
        alike = list(group)
        out += alike if depth < 0 else _lines(" " * depth, _declared(s.strip() for s in alike))
    return out


def _depth(line: str) -> int:
    """Spaces before a simple statement; -1 of any other line."""
    text = line.lstrip(" ")
    simple = text.endswith(";") and not _KEPT.match(text) and "= {" not in text.replace("= {0}", "")
    return len(line) - len(text) if simple else -1


def _declared(statements: Iterable[str]) -> Iterator[Sequence[str]]:
    """Pieces that a line may end after; a declaration of several variables is one statement."""
    kind = ""
    names: list[str] = []
    for s in statements:
        declaration = _DECLARED.fullmatch(s)
        if names and (declaration is None or declaration[1] != kind):
            yield _joined(kind, names)
            names = []
        if declaration is None:
            yield [s]
        else:
            kind = declaration[1]
            names.append(declaration[2])
    if names:
        yield _joined(kind, names)


def _joined(kind: str, names: Sequence[str]) -> list[str]:
    first, *others = [f"{name}," for name in names[:-1]] + [f"{names[-1]};"]
    return [f"{kind} {first}", *others]


def _lines(indent: str, statements: Iterable[Sequence[str]]) -> list[str]:
    out: list[str] = []
    alone = True
    for pieces in statements:
        previous, alone = alone, len(pieces) > 1
        for k, piece in enumerate(pieces):
            separate = not k and (alone or previous)
            if out and not separate and len(out[-1]) + 1 + len(piece) <= WIDTH:
                out[-1] += f" {piece}"
            else:
                out.append(f"{indent}{'    ' if k else ''}{piece}")
    return out


ARITHMETIC = frozenset({Op.ADD, Op.SUB, Op.MUL, Op.NEG, Op.RECIP})


def single_use_values(
    plan: Schedule, outputs: Iterable[Node], stored: Iterable[Node] = ()
) -> frozenset[Node]:
    """Sums and products whose only use is in the block that computes them.

    outputs: every use of a value after all stages and loops. stored: those that are read once, at
    a store in the block that computes them.
    """
    uses = Counter(outputs)
    for group in plan.stages:
        _count(uses, group.preamble)
        if group.loop is not None:
            _count(uses, group.loop.body)
            uses.update(s.args[0] for s in group.loop.sums)
    inlinable = set(stored)
    for block, sums in _blocks(plan):
        nodes = {s for s in block if isinstance(s, Node)}
        inlinable |= nodes & {s.args[0] for s in sums}
        inlinable |= {a for n in nodes if n.op is not Op.CALL for a in n.args if a in nodes}
    return frozenset(n for n in inlinable if uses[n] == 1 and n.op in ARITHMETIC)


def _count(uses: Counter[Node], block: Iterable[Statement]) -> None:
    for s in flat(block):
        # a value with two names keeps its line
        uses.update([s.old, s.old, s.new, s.new] if isinstance(s, Same) else s.args)


def _blocks(plan: Schedule) -> Iterator[tuple[list[Statement], tuple[Node, ...]]]:
    """Every block of statements, with the sums that a loop adds up from it."""
    for group in plan.stages:
        yield from ((b, ()) for b in _nested(group.preamble))
        if group.loop is not None:
            yield group.loop.body, group.loop.sums
            yield from ((b, ()) for s in group.loop.body if isinstance(s, If) for b in _sides(s))


def _nested(block: list[Statement]) -> Iterator[list[Statement]]:
    yield block
    for s in block:
        if isinstance(s, If):
            yield from _sides(s)


def _sides(s: If) -> Iterator[list[Statement]]:
    yield from _nested(s.then)
    yield from _nested(s.otherwise)


_FORMATS: dict[Op, str] = {
    Op.ADD: "{} + {}",
    Op.SUB: "{} - {}",
    Op.MUL: "{} * {}",
    Op.NEG: "-{}",
    Op.RECIP: "1.0 / {}",
    Op.SQRT: "sqrt({})",
    Op.CBRT: "cbrt({})",
    Op.RCBRT: "softehl_rcbrt({})",
    Op.LOG: "log({})",
    Op.EXP: "exp({})",
    Op.SIN: "sin({})",
    Op.COS: "cos({})",
    Op.ATAN2: "atan2({}, {})",
    Op.POWER: "pow({}, {})",
    **{op: f"{op}({{}})" for op in sorted(ELEMENTARY)},
    Op.LT: "{} < {}",
    Op.LE: "{} <= {}",
    Op.EQ: "{} == {}",
    Op.AND: "{} && {}",
    Op.OR: "{} || {}",
    Op.NOT: "!{}",
}

_ARRAYS = {
    "coordinates": "X[{}]",
    "dofs": "d[{}]",
    "direction": "t[{}]",
    "data": "a[{}]",
    "parameters": "parameters[{}]",
    "rule": "w[{}]",
    "point data": "b[{}]",
    "local": "s[{}]",
    "external": "p[{}]",
    "interpolated": "p{}",
    "interpolated direction": "t{}",
    "arrays": "0.0",
    "term history": "0.0",
}

_LONG = 64
"""Length of an expression that gets a name of its own, so that lines stay readable."""
_BARE: dict[Op, tuple[frozenset[Op], ...]] = {
    Op.ADD: (frozenset({Op.ADD, Op.SUB, Op.MUL, Op.RECIP, Op.NEG}), frozenset({Op.MUL, Op.RECIP})),
    Op.SUB: (frozenset({Op.ADD, Op.SUB, Op.MUL, Op.RECIP, Op.NEG}), frozenset({Op.MUL, Op.RECIP})),
    Op.MUL: (frozenset({Op.MUL, Op.RECIP}), frozenset()),
    Op.NEG: (frozenset(),),
    Op.RECIP: (frozenset(),),
}
"""Operands, by place, that an operation takes without parentheses; others take all of them."""


def number(value: float) -> str:
    """A double that C reads back exactly."""
    text = repr(float(value))
    return f"({text})" if text.startswith("-") else text


class Printer:
    """Lines of one function body; `kind` is the type of a value, `output` the name of an array."""

    kind, zero, output = "double", "0.0", "{}"
    terms = "terms"
    """Pointer to the places of history of terms."""

    def __init__(self, definition: Definition) -> None:
        self.d = definition
        self.lines: list[str] = []
        self.names: dict[Node, str] = {}
        self.temporaries = 0
        self.once: frozenset[Node] = frozenset()
        self.inside: dict[Node, str] = {}

    def read(self, plan: Schedule, outputs: Iterable[Node], stored: Iterable[Node] = ()) -> None:
        """Know the values that are used once, see `once.used_once`."""
        self.once = single_use_values(plan, outputs, stored)

    def text(self) -> str:
        """All lines, filled."""
        return "\n".join(filled(self.lines))

    def line(self, depth: int, text: str) -> None:
        self.lines.append("    " * depth + text)

    def ref(self, n: Node) -> str:
        if n.op is Op.CONST:
            return number(float(n.value))
        if isinstance(n.payload, InputEntry):
            return _ARRAYS[n.payload.array].format(n.payload.index)
        return f"({self.inside[n]})" if n in self.inside else self.names[n]

    def bare(self, n: Node) -> str:
        """An operand where no parentheses are needed."""
        return self.inside[n] if n in self.inside else self.ref(n)

    def fresh(self, n: Node, letter: str = "v") -> str:
        self.temporaries += 1
        self.names[n] = f"{letter}{self.temporaries}"
        return self.names[n]

    def block(self, depth: int, statements: Iterable[Statement]) -> None:
        for s in statements:
            if isinstance(s, If):
                self.branch(depth, s)
            elif isinstance(s, Same):
                self.names[s.old] = self.same(s)
            elif isinstance(s.payload, Routine):
                self.call(depth, s, s.payload)
            else:
                self.statement(depth, s)

    def statement(self, depth: int, s: Node) -> None:
        """Print a value as a statement."""
        right = self.expression(s)
        if self.hides(s, right):
            return
        kind = "int" if s.op in BOOLEAN else "double"
        self.line(depth, f"const {kind} {self.fresh(s)} = {right};")

    def hides(self, n: Node, expression: str) -> bool:
        """True, and no line, for a short expression that the only line that needs it will hold."""
        if n not in self.once or len(expression) > _LONG:
            return False
        self.inside[n] = expression
        return True

    def same(self, s: Same) -> str:
        """Reference to a value under another name."""
        return self.ref(s.new)

    def value(self, n: Node) -> str:
        """Reference to a value that is of this printer's kind in any case."""
        return self.ref(n)

    def type_of(self, n: Node) -> str:
        return self.kind

    def call(self, depth: int, n: Node, routine: Routine) -> None:
        """Run a routine on its operands; a failure is remembered."""
        operands = ", ".join(self.ref(a) for a in n.args) or "0.0"
        name = f"{abi.PREFIX}_{self.d.name}_{routine.name}"
        self.line(depth, f"double {self.fresh(n)}[{routine.outputs}];")
        arrays = array_operands(self.d, self.terms)
        self.line(
            depth, f"failed |= {name}({arrays}(const double[]){{{operands}}}, {self.ref(n)});"
        )

    def expression(self, n: Node) -> str:
        if isinstance(n.payload, ResultIndex):
            return f"{self.ref(n.args[0])}[{n.payload.index}]"
        if n.op is Op.POW:
            return f"pow({self.ref(n.args[0])}, {number(float(n.payload))})"  # type: ignore[arg-type]
        return _FORMATS[n.op].format(*(self.operand(n, k) for k in range(len(n.args))))

    def operand(self, n: Node, k: int) -> str:
        """The k-th operand of an expression."""
        a, bare = n.args[k], _BARE.get(n.op)
        parenthesised = bare is None or a.op in bare[k]
        return self.bare(a) if parenthesised else self.ref(a)

    def branch(self, depth: int, s: If) -> None:
        names = [self.fresh(n) for n in s.merged]
        for kind in dict.fromkeys(map(self.type_of, s.merged)):
            alike = [
                name for n, name in zip(s.merged, names, strict=True) if self.type_of(n) == kind
            ]
            self.line(depth, f"{kind} {', '.join(alike)};")
        for head, k, inner in (
            (f"if ({self.ref(s.condition)}) {{", 1, s.then),
            ("} else {", 2, s.otherwise),
        ):
            self.line(depth, head)
            self.block(depth + 1, inner)
            for n, name in zip(s.merged, names, strict=True):
                side = n.args[k]
                right = self.ref(side) if self.type_of(n) == "double" else self.value(side)
                self.line(depth + 1, f"{name} = {right};")
        self.line(depth, "}")


def dofs_expression(d: Definition) -> str:
    direct = len(d.unknowns)
    return f"({direct} + modes)" if d.interpolated else str(direct)


def design_width(d: Definition) -> int:
    """Length of a variation of an element: its coordinates, its data, the parameters."""
    return d.coordinate_width + len(d.data) + len(d.parameters)


def direction_expression(d: Definition, task: str) -> str:
    """Values of `direction` for each element, in a task that follows one; else nothing."""
    if task == abi.Task.PSEUDO_LOAD:
        return str(design_width(d))
    if task == abi.Task.FIELDS_RATE:
        return f"({design_width(d)} + {dofs_expression(d)})"
    if task in abi.ADJOINT:
        return str(design_width(d) + 3 * len(d.unknowns))
    return dofs_expression(d) if task == abi.Task.PRODUCT else ""


def point_width(d: Definition, task: str) -> int:
    """Values at a point of a task whose values are those of points."""
    return d.page_point_data if task == abi.Task.POINT_ADJOINT_RATE else len(d.fields)


def data_expression(d: Definition) -> str:
    """Data of one element, those of its points included."""
    if not d.point_data and not d.term_history:
        return str(len(d.data))
    return f"({len(d.data)} + {point_expression(d)} * points)"


def terms_expression(d: Definition) -> str:
    """Numbers of all history of terms of one point; empty where there is none."""
    return " + ".join(f"(ptrdiff_t)parameters[{length_place(d, h.array)}]" for h in d.term_history)


def length_place(d: Definition, array: int) -> int:
    """Place of the length of a run-time array in the parameters."""
    return len(d.parameters) + abi.ARRAY_ENTRIES * array + 1


def point_expression(d: Definition) -> str:
    """Data of one point."""
    if not d.term_history:
        return str(len(d.point_data))
    times = 2 if d.point_rates else 1
    return f"({len(d.point_data)} + {times} * ({terms_expression(d)}))"


def fields_expression(d: Definition) -> str:
    """Fields of one point, with the new history of terms."""
    return f"({len(d.fields)} + {terms_expression(d)})" if d.term_history else str(len(d.fields))


def point_values_expression(d: Definition, task: str) -> str:
    """Values at a point of a task whose values are those of points, new history of terms too."""
    plain = task == abi.Task.POINT_ADJOINT_RATE or not d.term_history
    return str(point_width(d, task)) if plain else fields_expression(d)


def array_operands(d: Definition, terms: str = "terms") -> str:
    """First operands of a call of a routine: where run-time arrays and history of terms stand."""
    return ("parameters, " if d.arrays else "") + (f"{terms}, " if d.term_history else "")


def array_arguments(d: Definition) -> str:
    """First arguments of a routine in its prototype."""
    terms = "const softehl_terms *terms, " if d.term_history else ""
    return ("const double *restrict parameters, " if d.arrays else "") + terms


TERMS = """/* History of terms of a point, one number for each, of the first lane: where it is read
   and where new values are written, and the distance of the next lane. */
typedef struct {
    const double *read;
    ptrdiff_t read_step;
    double *write;
    ptrdiff_t write_step;
} softehl_terms;
"""

"""Printing for several elements at once: every value is a vector with one lane per element.

Only straight-line kernels (loops written out, no branch) are printed this way.  A `group` function
handles as many elements as a vector has lanes; the public function walks over the batch and
repeats the last element to fill the last group.  Values that depend on parameters alone stay
scalars.
"""

from __future__ import annotations

from collections.abc import Sequence

from softehl.codegen import abi
from softehl.codegen.derive.outputs import Entry
from softehl.codegen.emit.printer import Printer, direction_expression, number
from softehl.codegen.emit.schedule import If, Schedule, Statement
from softehl.codegen.graph.graph import ELEMENTARY, FREE, Input, Node, Op
from softehl.codegen.graph.traverse import reachable
from softehl.codegen.language.definition import Definition

_LETTERS = {"coordinates": "X", "dofs": "d", "data": "a", "direction": "t"}
FUNCTIONS = frozenset({Op.SQRT, Op.CBRT, Op.RCBRT, Op.LOG, Op.EXP, Op.SIN, Op.COS}) | ELEMENTARY


def suits(plan: Schedule) -> bool:
    """True for a kernel without loops, branches and routines."""
    return (
        len(plan.stages) == 1
        and plan.stages[0].loop is None
        and not any(isinstance(s, If) or s.op is Op.CALL for s in plan.stages[0].before)
    )


def wrappers(text: str) -> list[str]:
    """Functions of vectors that `text` calls and that the header does not have."""
    needed = [op for op in sorted(ELEMENTARY) if f"softehl_v{op}(" in text]
    one = [
        f"#if SOFTEHL_LANES == 4\nSOFTEHL_LANEWISE({op})\n#else\n"
        f"#define softehl_v{op}(a) {op}(a)\n#endif\n"
        for op in needed
    ]
    return one + ([_ATAN2] if "softehl_vatan2(" in text else [])


_ATAN2 = """#if SOFTEHL_LANES == 4
static inline softehl_vec softehl_vatan2(softehl_vec y, softehl_vec x)
{
    return (softehl_vec){
        atan2(y[0], x[0]), atan2(y[1], x[1]), atan2(y[2], x[2]), atan2(y[3], x[3])};
}
#else
#define softehl_vatan2(y, x) atan2(y, x)
#endif
"""


class _LanePrinter(Printer):
    """A printer that knows which values are vectors."""

    def __init__(self, definition: Definition) -> None:
        super().__init__(definition)
        self.scalar: dict[Node, bool] = {}

    def is_scalar(self, n: Node) -> bool:
        """True when all lanes hold the same value."""
        if n not in self.scalar:
            for m in reachable([n], stop=self.scalar.__contains__):
                if isinstance(m.payload, Input):
                    self.scalar[m] = m.payload.array == "parameters"
                elif m not in self.scalar:
                    self.scalar[m] = all(self.scalar[a] for a in m.args)
        return self.scalar[n]

    def ref(self, n: Node) -> str:
        if isinstance(n.payload, Input) and n.payload.array != "parameters":
            return _LETTERS[n.payload.array] + str(n.payload.index)
        return super().ref(n)

    def statement(self, depth: int, s: Statement) -> None:
        assert isinstance(s, Node)
        if self.is_scalar(s):
            super().block(depth, [s])
            return
        right = self.expression(s)
        if s.op in FUNCTIONS:
            right = f"softehl_v{s.op}({self.ref(s.args[0])})"
        elif s.op is Op.ATAN2:
            right = f"softehl_vatan2({', '.join(self.as_vector(a) for a in s.args)})"
        elif s.op is Op.POW:
            right = f"softehl_vpow({self.ref(s.args[0])}, {number(float(s.payload))})"  # type: ignore[arg-type]
        self.line(depth, f"const V {self.fresh(s)} = {right};")

    def as_vector(self, n: Node) -> str:
        """Reference that is a vector in any case."""
        return f"softehl_splat({self.ref(n)})" if self.is_scalar(n) else self.ref(n)


def function(
    definition: Definition, task: str, entries: Sequence[Entry], plan: Schedule
) -> tuple[str, int]:
    """C text of one kernel (group function and batch loop) and the number of its temporaries."""
    p = _LanePrinter(definition)
    _loads(p, task)
    outputs = _Stores(p, task, entries)
    for s in plan.stages[0].before:
        p.statement(1, s)
        outputs.flush()
    name = abi.function_name(definition.name, task)
    body = "\n".join(p.lines)
    group = f"static void {name}_group(\n    {_GROUP_ARGUMENTS})\n{{\n{_GROUP_UNUSED}\n{body}\n}}\n"
    return f"{group}\n{_batch(definition, task)}", p.temporaries


_GROUP_ARGUMENTS = """const double *restrict X, const double *restrict d, const double *restrict a,
    const double *restrict t, const double *restrict parameters,
    double *restrict R, double *restrict K"""
_GROUP_UNUSED = "    (void)X, (void)d, (void)a, (void)t, (void)parameters, (void)R, (void)K;"


def _widths(d: Definition, task: str) -> dict[str, int]:
    """Values per element of each array that a task reads."""
    size = len(d.unknowns)
    along = int(direction_expression(d, task) or 0)
    coordinates = d.coordinate_width
    data = len(d.data) + len(d.point_data) * len(d.rule.weights)
    return {"coordinates": coordinates, "dofs": size, "data": data, "direction": along}


def _loads(p: _LanePrinter, task: str) -> None:
    for array, width in _widths(p.d, task).items():
        letter = _LETTERS[array]
        for start in range(0, width, 4):
            names = [f"{letter}{k}" for k in range(start, min(start + 4, width))]
            p.line(1, f"V {', '.join(names)};")
            pointers = ", ".join(f"&{n}" for n in names)
            p.line(1, f"softehl_load{len(names)}({letter} + {start}, {width}, {pointers});")
            p.line(1, " ".join(f"(void){n};" for n in names))


class _Stores:
    """Outputs in groups of up to four neighbours, each stored as soon as it is complete."""

    def __init__(self, p: _LanePrinter, task: str, entries: Sequence[Entry]) -> None:
        size = 1 if task == abi.Task.ENERGY else len(p.d.unknowns)
        flat: dict[str, dict[int, Node]] = {"R": {}, "K": {}}
        for x in entries:
            if x.column is None:
                flat["R"][x.row.position] = x.node
            else:
                flat["K"][x.row.position * size + x.column.position] = x.node
        self.p = p
        self.groups = [
            (f"{letter} + {start}, {len(values)}", [values[k] for k in range(start, stop)])
            for letter, values in flat.items()
            for start in range(0, len(values), 4)
            for stop in [min(start + 4, len(values))]
        ]
        self.flush()

    def flush(self) -> None:
        """Print the groups whose values are all known by now."""
        waiting = []
        for target, nodes in self.groups:
            if all(n in self.p.names or n.op in FREE for n in nodes):
                chunk = ", ".join(self.p.as_vector(n) for n in nodes)
                self.p.line(1, f"softehl_store{len(nodes)}({target}, {chunk});")
            else:
                waiting.append((target, nodes))
        self.groups = waiting


def _batch(d: Definition, task: str) -> str:
    """The public function: full groups, then one group padded with the last element."""
    name = abi.function_name(d.name, task)
    size = 1 if task == abi.Task.ENERGY else len(d.unknowns)
    square = size * size if task == abi.Task.TANGENT else 0
    widths = _widths(d, task)
    at = {k: f"{k} + {w} * e" if w else "0" for k, w in widths.items()}
    tangent = f"tangent + {square} * e" if square else "0"
    lines = [
        abi.declaration(d.name, task),
        "{",
        "    (void)points, (void)modes, (void)rule, (void)basis, (void)data, (void)tangent;",
        f"    (void)parameters, (void)direction{'' if d.coordinates else ', (void)coordinates'};",
        "    ptrdiff_t e = 0;",
        "    for (; e + SOFTEHL_LANES <= n; e += SOFTEHL_LANES)",
        f"        {name}_group({', '.join(at.values())}, parameters,",
        f"            values + {size} * e, {tangent});",
        "    if (e == n) return;",
    ]
    for array, letter in _LETTERS.items():
        lines.append(f"    double {letter}[SOFTEHL_LANES * {max(widths[array], 1)}];")
        if widths[array]:
            lines.append(
                f"    softehl_pad({letter}, {array} + {widths[array]} * e, {widths[array]}, n - e);"
            )
        else:
            lines.append(f"    {letter}[0] = 0.0;")
    lines += [
        f"    double R[SOFTEHL_LANES * {size}], K[SOFTEHL_LANES * {max(square, 1)}];",
        f"    {name}_group(X, d, a, t, parameters, R, K);",
        f"    for (ptrdiff_t i = 0; i < {size} * (n - e); ++i) values[{size} * e + i] = R[i];",
    ]
    if square:
        lines.append(
            f"    for (ptrdiff_t i = 0; i < {square} * (n - e); ++i)"
            f" tangent[{square} * e + i] = K[i];"
        )
    return "\n".join([*lines, "}", ""])

"""A kernel for several elements at once: every value is a vector with one lane per element.

A `group` function handles as many elements as a vector has lanes: pointers, stages, loops over the
points, stores.  The public function walks over the batch (`softehl_batch` in the header).
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Sequence

from softehl.codegen import abi
from softehl.codegen.derive.output_entries import OutputArray, OutputEntry, OutputSlot
from softehl.codegen.emit.batch_functions import functions, widths
from softehl.codegen.emit.c_printer import (
    Printer,
    design_width,
    dofs_expression,
    fields_expression,
    point_expression,
    point_values_expression,
    point_width,
    terms_expression,
)
from softehl.codegen.emit.code_motion import If, Loop, Same, Schedule, Statement, flat
from softehl.codegen.emit.instruction_scheduling import ADDITIONS
from softehl.codegen.emit.product_loops import ProductLoops
from softehl.codegen.emit.simd_printer import LanePrinter
from softehl.codegen.graph.graph import FREE, InputEntry, Node, Op
from softehl.codegen.graph.traversal import reachable
from softehl.codegen.language.definition import Definition


def gather(p: Printer, depth: int, value: str, array: str, offset: int = 0) -> None:
    """Values and xi-derivatives of the interpolated fields at the point.

    offset: entries of the array that stand before those of the dofs.
    """
    names = [f"{value}{k}" for k in range(p.d.components)]
    unknowns = p.output.format(array)
    p.line(depth, f"{p.kind} {', '.join(f'{name} = {p.zero}' for name in names)};")
    p.line(depth, "for (ptrdiff_t i = 0; i < modes; ++i) {")
    for name, shape in zip(names, _shapes(p.d, "i"), strict=True):
        p.line(depth + 1, f"{name} += {shape} * {unknowns}[{offset + len(p.d.unknowns)} + i];")
    p.line(depth, "}")
    p.line(depth, f"{', '.join(f'(void){name}' for name in names)};")


def _shapes(d: Definition, mode: str) -> list[str]:
    """Places of the components of a shape function in the basis of a point."""
    offsets = ["", *(f" + {k}" for k in range(1, d.components))]
    return [f"B[{d.components} * {mode}{offset}]" for offset in offsets]


def _letters(d: Definition) -> list[str]:
    """Names of the components of one shape function: N, D of the first field, N1, D1, ..."""
    return [f"{letter}{k or ''}" for k in range(d.components // 2) for letter in "ND"]


def scatter(p: Printer, depth: int, task: str, entries: Sequence[OutputEntry]) -> None:
    """Outputs of the point spread over the shape functions."""
    direct = len(p.d.unknowns)
    at = {(x.row, x.column): p.value(x.node) for x in entries}
    p.line(depth, "for (ptrdiff_t i = 0; i < modes; ++i) {")
    letters = _letters(p.d)
    values = zip(letters, _shapes(p.d, "i"), strict=True)
    p.line(depth + 1, f"const double {', '.join(f'{name} = {shape}' for name, shape in values)};")
    p.line(depth + 1, f"{', '.join(f'(void){name}' for name in letters)};")
    for column, target in _scatter_targets(p.d, task):
        left = _combination(letters, [at.get(k) for k in column])
        if left:
            p.line(depth + 1, f"{p.output.format(target[0])}{target[1:]} += {left};")
    size = range(p.d.components)
    blocks = [[at.get((OutputSlot(True, r), OutputSlot(True, c))) for r in size] for c in size]
    if any(value is not None for pair in blocks for value in pair):
        for c, pair in enumerate(blocks):
            right = _combination(letters, pair) or p.zero
            p.line(depth + 1, f"const {p.kind} r{c} = {right};")
        p.line(depth + 1, "for (ptrdiff_t j = 0; j < modes; ++j)")
        products = " + ".join(f"r{c} * {shape}" for c, shape in enumerate(_shapes(p.d, "j")))
        entry = f"[({direct} + i) * {dofs_expression(p.d)} + {direct} + j]"
        p.line(depth + 2, f"{p.output.format('K')}{entry} += {products};")
    p.line(depth, "}")


Key = tuple[OutputSlot, OutputSlot | None]


def _scatter_targets(d: Definition, task: str) -> list[tuple[list[Key], str]]:
    """Pairs (components of an output, its index for basis function i)."""
    direct, dofs = len(d.unknowns), dofs_expression(d)
    both = [OutputSlot(True, k) for k in range(d.components)]
    out: list[tuple[list[Key], str]] = [([(s, None) for s in both], f"R[{direct} + i]")]
    if task == abi.Task.TANGENT:
        for k in range(direct):
            out.append(
                ([(s, OutputSlot(False, k)) for s in both], f"K[({direct} + i) * {dofs} + {k}]")
            )
            out.append(
                ([(OutputSlot(False, k), s) for s in both], f"K[{k} * {dofs} + {direct} + i]")
            )
    return out


def _combination(letters: Sequence[str], values: Sequence[str | None]) -> str:
    return " + ".join(f"{b} * {v}" for b, v in zip(letters, values, strict=True) if v is not None)


_READ = {"coordinates": "X", "dofs": "d", "data": "a", "direction": "t"}


def function(
    definition: Definition, task: str, entries: Sequence[OutputEntry], plan: Schedule
) -> tuple[str, int]:
    """C text of one kernel (group function and batch loop) and the number of its temporaries."""
    p = LanePrinter(definition)
    _LaneGroup(p, task, entries).write(plan)
    return functions(definition, task, p.text()), p.temporaries


def along_basis(x: OutputEntry) -> bool:
    """True if an output is spread over the shape functions of an interpolated field."""
    return x.row.basis or (x.column is not None and x.column.basis)


class _LaneGroup:
    """The body of a group function."""

    def __init__(self, p: LanePrinter, task: str, entries: Sequence[OutputEntry]) -> None:
        self.p, self.task, self.entries = p, task, entries
        self.widths = widths(p.d, task)
        self.scattered = any(map(along_basis, entries))
        by_products = any(x.array is not OutputArray.OUTPUT for x in entries)
        self.products = ProductLoops(p, entries) if by_products else None
        self.stores = _Stores(p, self._targets())
        needed = reachable([x.node for x in entries])
        self.fallible = any(n.op is Op.CALL for n in needed)
        self.inputs = {p.ref(n) for n in needed if isinstance(n.payload, InputEntry)}

    def write(self, plan: Schedule) -> None:
        p = self.p
        stored = [*self.stores.once(), *(self.products.once() if self.products else ())]
        p.read(plan, [x.node for x in self.entries], stored)
        if self.fallible:
            p.line(1, "M failed = softehl_mask(0);")
        if p.d.term_history:
            p.terms = "&terms"
            p.line(1, "softehl_terms terms = {0, 0, 0, 0};")
            p.line(1, "(void)terms;")
        self._loads()
        if self.products:
            self.products.declare()
        self.stores.start()
        for group in plan.stages:
            for s in group.preamble:
                p.block(1, [s])
                self.stores.mark_computed(_values(s))
            if group.loop is not None:
                self._loop(group.loop)
                self.stores.mark_computed(group.loop.sums)
        self._finish()

    def _loads(self) -> None:
        p, d = self.p, self.p.d
        fixed = {"coordinates": d.coordinate_width, "dofs": len(d.unknowns), "data": self._data()}
        along: dict[str, int] = dict.fromkeys(abi.DESIGN, design_width(d))
        fixed["direction"] = along.get(self.task, 0)
        if self.task in (abi.Task.PRODUCT, abi.Task.FIELDS_RATE):
            fixed["direction"] += len(d.unknowns)
        if self.task in abi.ADJOINT:
            fixed["direction"] += 3 * len(d.unknowns)
        for array, count in fixed.items():
            self._load(1, _READ[array], count, self.widths[array], _READ[array])
        if not d.interpolated:
            return
        arrays = {"d": self.widths["dofs"]}
        if self.task in (abi.Task.PRODUCT, abi.Task.FIELDS_RATE):
            arrays["t"] = self.widths["direction"]
        for letter, size in arrays.items():
            self._array("const V", letter, size)
            p.lines += ["#if SOFTEHL_LANES > 1"]
            p.line(1, f"softehl_gather({letter}_lanes, {letter}, {size});")
            p.lines += ["#endif"]
        if self.scattered:
            for letter, width in self._written().items():
                self._array("V", letter, width)
                p.line(1, f"for (ptrdiff_t i = 0; i < {width}; ++i)")
                p.line(2, f"{letter}_lanes[i] = {p.zero};")

    def _data(self) -> int:
        """Data to load before any loop: with those of the points where the loop is written out."""
        inputs = [n.payload for n in reachable(x.node for x in self.entries)]
        used = [i.index + 1 for i in inputs if isinstance(i, InputEntry) and i.array == "data"]
        return max([len(self.p.d.data), *used])

    def _array(self, kind: str, letter: str, size: str) -> None:
        """Lanes of an array whose size is known at run time; with one lane, the array itself."""
        self.p.lines += [
            "#if SOFTEHL_LANES > 1",
            f"    V {letter}_lanes[{size}];",
            "#else",
            f"    {kind} *const {letter}_lanes = {letter};",
            "#endif",
        ]

    def _load(
        self, depth: int, letter: str, count: int, width: str, pointer: str, number: int = 0
    ) -> None:
        """Load values of all lanes from a pointer; number: of the first of them."""
        names = [f"{letter}{k}" for k in range(number, number + count)]
        for name in names:
            self.p.line(depth, f"V {name};")
        for start in range(0, count, 4):
            pointers = [f"&{n}" for n in names[start : start + 4]]
            source = f"{pointer} + {start}, {width}"
            self.p.line(depth, f"softehl_load{len(pointers)}({source}, {', '.join(pointers)});")
        for name in names:
            if name not in self.inputs:
                self.p.line(depth, f"(void){name};")

    def _written(self) -> dict[str, str]:
        arrays = {"R": self.widths["values"], "K": self.widths["tangent"]}
        return {letter: width for letter, width in arrays.items() if width != "0"}

    def _targets(self) -> list[tuple[str, list[Node]]]:
        """Outputs that are complete when all loops are done, by up to four neighbours."""
        d = self.p.d
        if self.task in abi.AT_POINTS or self.scattered:
            return []
        flat: dict[str, dict[int, Node]] = {"R": {}, "K": {}}
        for x in self.entries:
            if x.array is not OutputArray.OUTPUT:
                continue
            if x.column is None:
                flat["R"][x.row.position] = x.node
            else:
                flat["K"][x.row.position * len(d.unknowns) + x.column.position] = x.node
        return [
            (f"{letter} + {start}, {len(values)}", [values[k] for k in range(start, stop)])
            for letter, values in flat.items()
            for start in range(0, len(values), 4)
            for stop in [min(start + 4, len(values))]
        ]

    def _loop(self, loop: Loop) -> None:
        p, d = self.p, self.p.d
        for s in loop.sums:
            kind = "double" if p.is_scalar(s) else "V"
            p.line(1, f"{kind} {p.fresh(s, 's')} = {{0}};")
        p.line(1, "for (ptrdiff_t q = 0; q < points; ++q) {")
        p.line(2, f"const double *restrict w = rule + {d.rule.dimension + 1} * q;")
        p.line(2, "(void)w;")
        if d.point_data or d.term_history:
            p.line(2, f"const double *restrict b = a + {len(d.data)} + {point_expression(d)} * q;")
            self._point_data()
        if d.interpolated:
            p.line(2, f"const double *restrict B = basis + {d.components} * modes * q;")
            gather(p, 2, "p", "d")
            if self.task == abi.Task.PRODUCT:
                gather(p, 2, "tp", "t")
            if self.task == abi.Task.FIELDS_RATE:
                gather(p, 2, "tp", "t", design_width(d))
        products = self.products if loop.outputs else None
        if products:
            products.start()
        self._body(loop, products)
        loop_entries = [x for x in self.entries if x.node in loop.outputs]
        if products:
            products.multiply()
        elif loop_entries and self.task in abi.AT_POINTS:
            self._fields(loop_entries)
        elif loop_entries:
            scatter(p, 2, self.task, loop_entries)
        p.line(1, "}")

    def _point_data(self) -> None:
        """Load the data of the point `q`, and say where its history of terms is."""
        p, d = self.p, self.p.d
        size = len(d.point_data)
        if not d.term_history:
            self._load(2, "b", size, self.widths["data"], "b")
            return
        first = size // 2 if d.point_rates else size
        self._load(2, "b", first, self.widths["data"], "b")
        if d.point_rates:
            p.line(2, f"const double *restrict rates = b + {first} + {terms_expression(d)};")
            self._load(2, "b", size - first, self.widths["data"], "rates", first)
            p.line(2, "(void)rates;")
        p.line(2, f"terms.read = b + {first}, terms.read_step = {self.widths['data']};")
        if self.task in abi.AT_POINTS:
            p.line(2, f"terms.write = R + {fields_expression(d)} * q + {len(d.fields)};")
            p.line(2, f"terms.write_step = {self.widths['values']};")

    def _body(self, loop: Loop, products: ProductLoops | None) -> None:
        """Print the values at a point; each is added to its sum at once, to save storage."""
        p = self.p
        sums: dict[Node, list[Node]] = {}
        for s in loop.sums:
            sums.setdefault(s.args[0], []).append(s)
        for n in [n for n in sums if n.op in FREE or not n.varying]:
            self._add(sums.pop(n))
        terms = immediate_sums(loop)
        for statement in loop.body:
            if isinstance(statement, Node) and statement in terms:
                for s, sign, term in terms[statement]:
                    p.line(2, f"{p.ref(s)} {sign}= {p.bare(term)};")
                continue
            if isinstance(statement, Same) and statement.new in terms:
                continue
            p.block(2, [statement])
            for n in _values(statement):
                self._add(sums.pop(n, []))
            if products:
                products.computed(_values(statement))

    def _add(self, sums: Sequence[Node]) -> None:
        for s in sums:
            self.p.line(2, f"{self.p.ref(s)} += {self.p.bare(s.args[0])};")

    def _fields(self, entries: Sequence[OutputEntry]) -> None:
        """Values at the point `q`: neighbours together."""
        runs: list[list[OutputEntry]] = []
        width = point_width(self.p.d, self.task)
        entries = [x for x in entries if x.row.position < width]  # terms are there
        for x in sorted(entries, key=lambda x: x.row.position):
            if runs and runs[-1][-1].row.position + 1 == x.row.position and len(runs[-1]) < 4:
                runs[-1].append(x)
            else:
                runs.append([x])
        for run in runs:
            at = f"R + {point_values_expression(self.p.d, self.task)} * q"
            at += f" + {run[0].row.position}"
            values = ", ".join(self.p.value(x.node) for x in run)
            self.p.line(2, f"softehl_store{len(run)}({at}, {self.widths['values']}, {values});")

    def _finish(self) -> None:
        """Write values that do not vary, sums of the basis, and not-a-number after a failure."""
        p = self.p
        if self.products:
            self.products.finish()
        fixed = [x for x in self.entries if not x.node.varying]
        if self.task in abi.AT_POINTS and fixed:
            p.line(1, "for (ptrdiff_t q = 0; q < points; ++q) {")
            self._fields(fixed)
            p.line(1, "}")
        if self.scattered:
            size = dofs_expression(p.d)
            for x in self.entries:
                if not along_basis(x) and x.node is not p.d.graph.zero:
                    k = x.row.position
                    at = f"K_lanes[{k} * {size} + {x.column.position}]" if x.column else None
                    p.line(1, f"{at or f'R_lanes[{k}]'} = {p.value(x.node)};")
            p.lines += ["#if SOFTEHL_LANES > 1"]
            for letter, width in self._written().items():
                p.line(1, f"softehl_scatter({letter}, {letter}_lanes, {width});")
            p.lines += ["#endif"]
        if self.fallible:
            p.line(1, "if (softehl_any(failed)) {")
            for letter, width in self._written().items():
                p.line(2, f"softehl_spoil(failed, {letter}, {width});")
            p.line(1, "}")


def immediate_sums(loop: Loop) -> dict[Node, list[tuple[Node, str, Node]]]:
    """Partial sums at a point that only a sum over the points uses: (sum, sign, term) instead.

    The terms go straight into the sum, each as a multiply-add where it is a product.
    """
    now = {s.old: s.new for s in flat(loop.body) if isinstance(s, Same)}
    used = [a for n in flat(loop.body) if isinstance(n, Node) for a in n.args]
    used += [*loop.outputs, *(s.args[0] for s in loop.sums)]
    uses = Counter(now.get(a, a) for a in used)
    plain = {s for s in loop.body if isinstance(s, Node)}
    sums: dict[Node, list[tuple[Node, str, Node]]] = {}
    for s in loop.sums:
        n: Node | None = now.get(s.args[0], s.args[0])
        while n is not None and n in plain and n.op in ADDITIONS and uses[n] == 1:
            signs = "+", "+" if n.op is Op.ADD else "-"
            first = [k for k in range(2) if signs[k] == "+" and n.args[k].op in ADDITIONS]
            inner = [k for k in first if n.args[k] in plain and uses[n.args[k]] == 1]
            others = [k for k in range(2) if not inner or k != inner[0]]
            sums[n] = [(s, signs[k], n.args[k]) for k in others]
            n = n.args[inner[0]] if inner else None
    return sums


def _values(s: Statement) -> Sequence[Node]:
    """Values that a statement computes."""
    if isinstance(s, If):
        return s.merged
    return [s if isinstance(s, Node) else s.old]


class _Stores:
    """Outputs in groups of neighbours; a group is stored as soon as all its values are computed."""

    def __init__(self, p: LanePrinter, targets: Iterable[tuple[str, list[Node]]]) -> None:
        self.p = p
        self.targets = list(targets)
        self.missing: list[int] = []
        self.waiting: dict[Node, list[int]] = {}

    def once(self) -> list[Node]:
        """Values that are stored once."""
        uses = Counter(n for _, nodes in self.targets for n in nodes)
        return [n for n, count in uses.items() if count == 1]

    def start(self) -> None:
        """Print the stores of values that need no computation."""
        for k, (_, nodes) in enumerate(self.targets):
            needed = [n for n in dict.fromkeys(nodes) if n.op not in FREE]
            self.missing.append(len(needed))
            for n in needed:
                self.waiting.setdefault(n, []).append(k)
            if not needed:
                self._print(k)

    def mark_computed(self, nodes: Iterable[Node]) -> None:
        """Print the groups that were waiting for the last of `nodes`."""
        for n in nodes:
            for k in self.waiting.pop(n, []):
                self.missing[k] -= 1
                if not self.missing[k]:
                    self._print(k)

    def _print(self, k: int) -> None:
        target, nodes = self.targets[k]
        values = ", ".join(map(self.p.value, nodes))
        self.p.line(1, f"softehl_store{len(nodes)}({target}, {values});")

"""Routines that a graph can call: local Newton iteration, inverse matrix, function of stretches.

A C function of a user is called in the same way (`External`).

Each is opaque to the passes and printed as a C function of its own (`emit.c_routines`).  Its
derivatives are results of routines and ordinary nodes, so that they can be differentiated again.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, fields
from fractions import Fraction

from softehl.codegen.external_function import HIGHEST, ExternalFunction
from softehl.codegen.external_function import upper as upper_entry
from softehl.codegen.graph.differentiation import gradient
from softehl.codegen.graph.divided_difference import Divided, exchange_inputs
from softehl.codegen.graph.graph import BOOLEAN, Graph, InputEntry, Node, Op, ResultIndex, Routine
from softehl.codegen.graph.guarded_products import guarded, plus
from softehl.codegen.graph.partial_derivatives import DifferentiationError
from softehl.codegen.graph.traversal import reachable, substitute, written_out

Matrix = list[list[Node]]
Pairs = list[tuple[Node, Node]]


@dataclass(frozen=True)
class LocalisedValues:
    """Values as functions of `local` and `external` inputs, with the nodes of the external ones."""

    values: tuple[Node, ...]
    external: tuple[Node, ...]


def localise(g: Graph, values: Sequence[Node], unknowns: Sequence[Node]) -> LocalisedValues:
    """Cut `values` off from the graph around them: what `unknowns` do not enter comes from outside.

    Values that can be computed once are computed outside, but not across a branch, whose other
    side may have no value there.
    """
    inside, nodes = depends(values, unknowns), reachable(values)
    branched = any(n.op is Op.BRANCH for n in nodes)
    leaves = (Op.NAME, Op.INPUT, Op.SUM, Op.ITEM)
    seen: set[Node] = set(unknowns)
    external: list[Node] = []
    stack = [*values, *(a for n in nodes if n in inside for a in n.args)]
    while stack:
        n = stack.pop()
        if n in seen or n in inside or n.op in (Op.CONST, Op.PI):
            continue
        seen.add(n)
        if n.op in BOOLEAN or (branched and n.op not in leaves):
            stack.extend(n.args)
        else:
            external.append(n)
    inputs = sorted(external, key=lambda n: n.id)
    replacement = {u: g.input("local", k) for k, u in enumerate(unknowns)}
    replacement |= {n: g.input("external", k) for k, n in enumerate(inputs)}
    return LocalisedValues(tuple(substitute(g, values, replacement)[0]), tuple(inputs))


def depends(values: Sequence[Node], sources: Iterable[Node]) -> set[Node]:
    """Nodes below `values` that `sources` enter, these among them."""
    inside = set(sources)
    for n in reachable(values):
        if any(a in inside for a in n.args):
            inside.add(n)
    return inside


def unroll_sums(
    g: Graph, values: Sequence[Node], inside: set[Node], points: Sequence[Sequence[Fraction]]
) -> list[Node]:
    """`values` with the sums among `inside` as sums of one term for each of the `points`."""

    def leaf(n: Node, q: int) -> Node:
        source = n.payload
        assert isinstance(source, InputEntry)
        return g.const(points[q][source.index]) if source.array == "rule" else n

    return written_out(g, values, len(points), leaf, inside)


def lift_inputs(
    g: Graph, values: Iterable[Node], local: Sequence[Node], external: Sequence[Node]
) -> list[Node]:
    """Localised values in the graph around them, with `local` and `external` put in."""
    replacement = {g.input("local", k): n for k, n in enumerate(local)}
    replacement |= {g.input("external", k): n for k, n in enumerate(external)}
    return substitute(g, list(values), replacement)[0]


def items(g: Graph, call: Node) -> list[Node]:
    """All results of a call."""
    routine = call.payload
    assert isinstance(routine, Routine)
    return [g.node(Op.ITEM, (call,), ResultIndex(k)) for k in range(routine.outputs)]


def result_index(item: Node) -> int:
    """Position of a result."""
    assert isinstance(item.payload, ResultIndex)
    return item.payload.index


# ------------------------------------------------------------------------------- local unknowns


@dataclass(frozen=True)
class Control:
    """Convergence criterion of a local iteration; it fails after `iterations` steps.

    Every equation must be below `tolerance` of the sum of |dg_i/dy * y| over all y that enter it,
    and every step below `tolerance` * (`size` + |s_k|), unless it is rounding: it becomes smaller
    no longer, or it changes no equation by more than the rounding of those sums.
    """

    tolerance: Fraction
    size: Fraction
    iterations: int


@dataclass(frozen=True, eq=False)
class NewtonRoutine(Routine):
    """Solution s of g(s, p) = 0 by Newton's method; operands: p, then the start of s.

    `by_local` is dg/ds, `by_external` dg/dp; all are localised.  The derivatives of s are those of
    the implicit function theorem, ds/dp = -(dg/ds)^-1 dg/dp, and none by the start.
    """

    equations: tuple[Node, ...]
    by_local: tuple[tuple[Node, ...], ...]
    by_external: tuple[tuple[Node, ...], ...]
    control: Control
    _jacobian: dict[Node, Matrix] = field(default_factory=dict)

    def partials(self, g: Graph, item: Node) -> Pairs:
        call = item.args[0]
        if call not in self._jacobian:
            self._jacobian[call] = self._slope(g, call)
        row = self._jacobian[call][result_index(item)]
        return list(zip(call.args, row, strict=False))

    def _slope(self, g: Graph, call: Node) -> Matrix:
        s, p = items(g, call), call.args[: self.inputs - self.outputs]
        A = [lift_inputs(g, row, s, p) for row in self.by_local]
        B = [lift_inputs(g, row, s, p) for row in self.by_external]
        X = inverse(g, A)
        columns = list(zip(*B, strict=True))
        return [[_contracted(g, [g.neg(x) for x in row], c) for c in columns] for row in X]

    def divided(self, between: Divided, call: Node) -> list[Node]:
        """Divided differences of the results: the equations have none."""
        g, other_call = between.g, between.other[call]
        s, p = items(g, call), call.args[: self.inputs - self.outputs]
        other = dict(zip([*s, *p], [*items(g, other_call), *other_call.args], strict=False))
        rows, same = between.derivatives(lift_inputs(g, self.equations, s, p), other)
        X = inverse(g, [row[: len(s)] for row in rows])
        moved = [_contracted(g, row[len(s) :], [between.rates[a] for a in p]) for row in rows]
        differences = [g.neg(_contracted(g, row, moved)) for row in X]
        if same is None:
            return differences
        quotients = [g.div(g.sub(a, other[a]), between.gap) for a in s]
        return [g.branch(same, a, b) for a, b in zip(differences, quotients, strict=True)]


def _contracted(g: Graph, a: Sequence[Node], b: Sequence[Node]) -> Node:
    """Sum of a_i b_i, in one branch where the b_i have one: its other side stays unseen."""
    total = g.zero
    for x, y in zip(a, b, strict=True):
        product = guarded(g, x, y)
        if product.op is Op.NEG and product.args[0].op is Op.BRANCH:
            c, then, otherwise = product.args[0].args
            product = g.branch(c, g.neg(then), g.neg(otherwise))
        total = plus(g, total, product)
    return total


def newton(g: Graph, name: str, local: LocalisedValues, control: Control) -> NewtonRoutine:
    """The routine that solves `local.values` = 0 for as many local unknowns."""
    count = len(local.values)
    s = [g.input("local", k) for k in range(count)]
    p = [g.input("external", k) for k in range(len(local.external))]
    gradients = [gradient(g, value, [*s, *p]) for value in local.values]
    return NewtonRoutine(
        name,
        len(p) + count,
        count,
        local.values,
        tuple(tuple(row[n] for n in s) for row in gradients),
        tuple(tuple(row[n] for n in p) for row in gradients),
        control,
    )


# --------------------------------------------------------------------------------------- matrices


@dataclass(frozen=True, eq=False)
class Inverse(Routine):
    """Inverse X of a matrix A, row by row, with partial pivoting: dX_ij = -X_ik dA_kl X_lj."""

    size: int

    def partials(self, g: Graph, item: Node) -> Pairs:
        X, (i, j) = items(g, item.args[0]), divmod(result_index(item), self.size)
        out = []
        for position, a in enumerate(item.args[0].args):
            k, l = divmod(position, self.size)  # noqa: E741
            out.append((a, g.neg(g.mul(X[i * self.size + k], X[l * self.size + j]))))
        return out

    def divided(self, between: Divided, call: Node) -> list[Node]:
        """Divided differences of the results: X - X' = -X (A - A') X'."""
        g, n = between.g, self.size
        X, Y = items(g, call), items(g, between.other[call])
        half = _product(g, n, X, [between.rates[a] for a in call.args])
        return [g.neg(v) for v in _product(g, n, half, Y)]


_INVERSES = {n: Inverse(f"inverse_{n}", n * n, n * n, n) for n in range(4, 33)}


def inverse(g: Graph, A: Matrix) -> Matrix:
    """Inverse of a square matrix of nodes: written out up to 3, a routine from 4 on."""
    n = len(A)
    if n > 3:
        flat = g.run(_INVERSES[n], [a for row in A for a in row])
        return [flat[i * n : (i + 1) * n] for i in range(n)]
    cofactors = [[_cofactor(g, A, i, j) for j in range(n)] for i in range(n)]
    determinant = _sum(g, list(zip(A[0], cofactors[0], strict=True)))
    return [[g.div(cofactors[j][i], determinant) for j in range(n)] for i in range(n)]


def _cofactor(g: Graph, A: Matrix, i: int, j: int) -> Node:
    n = len(A)
    if n == 1:
        return g.one
    rows, columns = ([k for k in range(n) if k != skip] for skip in (i, j))
    if n == 2:
        minor = A[rows[0]][columns[0]]
    else:
        (a, b), (c, d) = ([A[r][q] for q in columns] for r in rows)
        minor = g.sub(g.mul(a, d), g.mul(b, c))
    return g.neg(minor) if (i + j) % 2 else minor


def _sum(g: Graph, products: Iterable[tuple[Node, Node]]) -> Node:
    total = g.zero
    for a, b in products:
        total = g.add(total, g.mul(a, b))
    return total


def _product(g: Graph, n: int, A: Sequence[Node], B: Sequence[Node]) -> list[Node]:
    """Product of two matrices, row by row."""
    rows = [A[n * i : n * i + n] for i in range(n)]
    return [_sum(g, zip(row, B[j::n], strict=True)) for row in rows for j in range(n)]


# ------------------------------------------------------------------------ functions of stretches

SYMMETRIC = ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))
"""Order of the six independent entries of a symmetric 3x3 matrix."""


@dataclass(frozen=True, eq=False)
class Isotropic(Routine):
    """A symmetric function w of the eigenvalues of C, or its derivatives by the entries of C.

    Operands: C_11, C_22, C_33, C_12, C_13, C_23, then what else enters w.  Results by `order`: 0:
    w; 1: the six derivatives; 2: the upper triangle of the 6x6 second derivatives, row by row; 3:
    the third ones, as `TRIPLES`. They are exact also where eigenvalues are equal or nearly so.
    """

    energy: Node
    order: int
    _relatives: dict[str, Routine] = field(default_factory=dict)

    def partials(self, g: Graph, item: Node) -> Pairs:
        if self.order == HIGHEST_OF_STRETCHES:
            raise DifferentiationError(
                f"{self.name}: a function of principal stretches has no fourth derivatives, write "
                "it by invariants"
            )
        args, k = item.args[0].args, result_index(item)
        raised = g.run(self._relative(self.energy, self.order + 1, self.name), args)
        if self.order == 0:
            by_C = raised
        elif self.order == 1:
            by_C = [raised[upper(k, i)] for i in range(6)]
        else:
            pair = _UPPER[k]
            by_C = [raised[TRIPLES.index(tuple(sorted((*pair, i))))] for i in range(6)]
        pairs = list(zip(args, by_C, strict=False))
        for j, p in enumerate(args[6:]):
            source = g.input("external", j)
            slope = gradient(g, self.energy, [source])[source]
            if slope is not g.zero:
                label = f"{self.name}_by_{j}"
                pairs.append((p, g.run(self._relative(slope, self.order, label), args)[k]))
        return pairs

    def _relative(self, energy: Node, order: int, name: str) -> Routine:
        label = f"{name}_{order}" if order != self.order else name
        if label not in self._relatives:
            self._relatives[label] = isotropic(label, self.inputs, energy, order)
        return self._relatives[label]


def isotropic(name: str, inputs: int, energy: Node, order: int = 0) -> Isotropic:
    """The routine of a localised symmetric function of three eigenvalues."""
    return Isotropic(name, inputs, (1, 6, 21, len(TRIPLES))[order], energy, order)


def upper(i: int, j: int) -> int:
    """Position of entry (i, j) in the upper triangle of a symmetric 6x6 matrix."""
    i, j = min(i, j), max(i, j)
    return i * 6 - i * (i - 1) // 2 + j - i


_UPPER = [(i, j) for i in range(6) for j in range(i, 6)]
TRIPLES: list[tuple[int, ...]] = [
    (i, j, k) for i in range(6) for j in range(i, 6) for k in range(j, 6)
]
"""Order of the third derivatives by the entries of a symmetric matrix."""
HIGHEST_OF_STRETCHES = 3

PAIRS = ((0, 1), (0, 2), (1, 2))
"""Order of the pairs of eigenvalues."""


def derivatives_of_energy(g: Graph, r: Isotropic) -> list[Node]:
    """Values that the C function of an order needs: 0: w; 1: w_a; 2: w_a, then those below.

    The upper triangle of w_ab, row by row, then d_ab = (w_a - w_b) / (c_a - c_b) of every pair: w_b
    is w_a with the two exchanged. For the order 3: see `_third_derivatives`.
    """
    if r.order == 0:
        return [r.energy]
    c = [g.input("local", k) for k in range(3)]
    first = gradient(g, r.energy, c)
    if r.order == 1:
        return [first[a] for a in c]
    if r.order == HIGHEST_OF_STRETCHES:
        return _third_derivatives(g, c, [first[a] for a in c])
    second = [gradient(g, first[a], c)[b] for k, a in enumerate(c) for b in c[k:]]
    divided = [exchange_inputs(g, [first[c[a]]], c[a], c[b])(first[c[a]]) for a, b in PAIRS]
    return [*(first[a] for a in c), *second, *divided]


def _third_derivatives(g: Graph, c: Sequence[Node], first: Sequence[Node]) -> list[Node]:
    """The w_abc with a <= b <= c, the derivatives of every d_ab by the three eigenvalues, d_123.

    That by a third eigenvalue is (w_ak - w_bk) / (c_a - c_b); that by c_a itself is the divided
    difference of d_ab when c_a moves to another value, which the caller gives as the input 3 + a
    and sets equal to it. d_123 = (d_13 - d_23) / (c_1 - c_2) is symmetric in all three.
    """
    third = []
    for i in range(3):
        for j in range(i, 3):
            bent = gradient(g, gradient(g, first[i], c)[c[j]], c)
            third += [bent[a] for a in c[j:]]
    derivatives = []
    divided = [exchange_inputs(g, [first[a]], c[a], c[b])(first[a]) for a, b in PAIRS]
    for d, (a, b) in zip(divided, PAIRS, strict=True):
        for k in range(3):
            if k in (a, b):
                other = g.input("local", 3 + k)
                moved = Divided(g, {c[k]: other}, g.sub(c[k], other), {c[k]: g.one})
                derivatives.append(moved(d))
            else:
                slope = gradient(g, first[a], c)[c[k]]
                derivatives.append(exchange_inputs(g, [slope], c[a], c[b])(slope))
    d_13 = divided[1]
    return [*third, *derivatives, exchange_inputs(g, [d_13], c[0], c[1])(d_13)]


# ------------------------------------------------------------------------- functions of the user


@dataclass(frozen=True, eq=False)
class External(Routine):
    """A C function of the user, with its derivatives up to `order`.

    Operands: its address where it has no text, then its arguments.  Results: values, first
    derivatives, upper triangles of the second ones.  where: line of the page.
    """

    function: ExternalFunction
    order: int
    where: str = field(default="", compare=False)
    _raised: dict[int, Routine] = field(default_factory=dict)

    def partials(self, g: Graph, item: Node) -> Pairs:
        f, call, k = self.function, item.args[0], result_index(item)
        m, n, args = f.inputs, f.outputs, item.args[0].args[self.inputs - f.inputs :]
        if k < n:
            call = self._up_to(g, 1, call)
            positions = [n + k * m + j for j in range(m)]
        elif k < n * (1 + m):
            call = self._up_to(g, 2, call)
            k, i = divmod(k - n, m)
            start = n * (1 + m) + k * m * (m + 1) // 2
            positions = [start + upper_entry(m, i, j) for j in range(m)]
        else:
            raise DifferentiationError(self._missing(3))
        return [
            (a, g.node(Op.ITEM, (call,), ResultIndex(p)))
            for a, p in zip(args, positions, strict=True)
        ]

    def _up_to(self, g: Graph, order: int, call: Node) -> Node:
        """Call of the same function with derivatives of an order."""
        if order <= self.order:
            return call
        if order > self.function.orders:
            raise DifferentiationError(self._missing(order))
        if order not in self._raised:
            self._raised[order] = external(
                f"{self.name}_{order}", self.function, order=order, where=self.where
            )
        return g.node(Op.CALL, call.args, self._raised[order])

    def _missing(self, order: int) -> str:
        f = self.function
        if order > HIGHEST:
            remedy = "third derivatives have no place in the prototype: give the first ones as y"
        elif f.is_complex:
            remedy = (
                f"return {'d' * (order - 1)}y as well and say derivatives={order - 1}, the next "
                "order follows by complex steps"
            )
        elif f.derivatives == 0:
            remedy = (
                "write it for numbers of type `double complex`, then derivatives follow by complex "
                f"steps, or return them and say derivatives={order}"
            )
        else:
            remedy = f"return them as {'d' * order}y and say derivatives={order}"
        context = f"{self.where}: " if self.where else ""
        return (
            f"{context}{f.name} has derivatives of order {f.orders}, and the kernel needs those of "
            f"order {order}: {remedy}"
        )


def external(name: str, f: ExternalFunction, *, order: int = 0, where: str = "") -> External:
    """The routine of a C function."""
    return External(name, f.inputs + (not f.text), f.results(order), f, order, where)


def external_functions(roots: Iterable[Node]) -> dict[Node, ExternalFunction]:
    """Calls of C functions below some values, also those inside other routines."""
    functions: dict[Node, ExternalFunction] = {}
    waiting, seen = [list(roots)], set[Routine]()
    while waiting:
        for n in reachable(waiting.pop()):
            if isinstance(n.payload, External):
                functions[n] = n.payload.function
            elif isinstance(n.payload, Routine) and n.payload not in seen:
                seen.add(n.payload)
                waiting.append(_inside(n.payload))
    return functions


def _inside(r: Routine) -> list[Node]:
    """Values that a routine computes from its operands."""
    values = [getattr(r, f.name) for f in fields(r)]
    rows = [v if isinstance(v, tuple) else (v,) for v in values]
    return [n for row in rows for n in row if isinstance(n, Node)]

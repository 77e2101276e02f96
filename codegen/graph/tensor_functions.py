"""Functions of a matrix on the graph: f of a symmetric one, its eigenvalues, the exponential.

A `TensorFunction` has a value, a derivative along a direction (`adjoint`), all first derivatives
(`slope`) and the second ones along a direction (`curvature`); each is a routine, so that two
derivatives by the matrix can be taken in any order. `lower` replaces them before a kernel is
printed: the eigenvalues of a matrix are computed once, f at them becomes ordinary nodes, and small
routines without derivatives put the results together. The derivatives of f are divided differences
(Daleckii and Krein 1965, and their second order), which subtract no close numbers.
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from enum import StrEnum
from fractions import Fraction

from softehl.codegen.graph.differentiation import gradient
from softehl.codegen.graph.divided_difference import Divided, Quotient, nearly_equal
from softehl.codegen.graph.graph import Graph, Node, Op, ResultIndex, Routine
from softehl.codegen.graph.partial_derivatives import DifferentiationError, partials
from softehl.codegen.graph.routines import lift_inputs
from softehl.codegen.graph.traversal import rewrite

Nodes = list[Node]


class FunctionPart(StrEnum):
    """Results of a routine of a tensor function.

    With Y(x) the results and x the entries of the matrix: VALUE Y; ADJOINT sum of p_i dY_i/dx_j;
    SLOPE dY_i/dx_j; CURVATURE the upper triangle of the sum of p_i d2Y_i/dx_j dx_k.
    """

    VALUE = "value"
    ADJOINT = "adjoint"
    SLOPE = "slope"
    CURVATURE = "curvature"


@dataclass(frozen=True, eq=False)
class TensorRoutine(Routine):
    """Part of a tensor function; operands: entries x, external values, and p where it has one."""

    function: TensorFunction
    part: FunctionPart

    def partials(self, g: Graph, item: Node) -> list[tuple[Node, Node]]:
        assert isinstance(item.payload, ResultIndex)
        return self.function.partials(g, self.part, item.args[0].args, item.payload.index)

    @property
    def joint(self) -> bool:
        return self.part is FunctionPart.VALUE

    def pullback(self, g: Graph, call: Node, seeds: Mapping[int, Node]) -> list[tuple[Node, Node]]:
        f, args = self.function, call.args
        p = [seeds.get(k, g.zero) for k in range(self.outputs)]
        pairs = list(zip(args, f.run(g, FunctionPart.ADJOINT, [*args, *p]), strict=False))
        for j, by in f.by_externals(g).items():
            total = g.zero
            for value, seed in zip(by.run(g, FunctionPart.VALUE, args), p, strict=True):
                total = g.add(total, g.mul(seed, value))
            pairs.append((args[f.entries + j], total))
        return pairs


@dataclass(eq=False)
class TensorFunction:
    """A function of the independent entries of a matrix.

    name: unique in a model; what: its name in messages. size: rows of the matrix. externals: number
    of other values that enter.
    """

    name: str
    what: str
    size: int
    externals: int = 0
    _routines: dict[FunctionPart, TensorRoutine] = field(default_factory=dict)

    @property
    def entries(self) -> int:
        """Number of entries of the matrix that are independent."""
        return self.size * (self.size + 1) // 2

    @property
    def results(self) -> int:
        """Number of results of the function itself."""
        return self.entries

    @property
    def slope_count(self) -> int:
        """Number of results of the slope."""
        return self.results * self.entries

    def routine(self, part: FunctionPart) -> TensorRoutine:
        """The routine of a part, each made once."""
        if part not in self._routines:
            n = self.entries
            outputs = {
                FunctionPart.VALUE: self.results,
                FunctionPart.ADJOINT: n,
                FunctionPart.SLOPE: self.slope_count,
                FunctionPart.CURVATURE: n * (n + 1) // 2,
            }[part]
            along = self.results if part in (FunctionPart.ADJOINT, FunctionPart.CURVATURE) else 0
            inputs = n + self.externals + along
            self._routines[part] = TensorRoutine(f"{self.name}_{part}", inputs, outputs, self, part)
        return self._routines[part]

    def run(self, g: Graph, part: FunctionPart, args: Sequence[Node]) -> Nodes:
        """Results of a part."""
        return g.run(self.routine(part), args)

    def slope(self, g: Graph, derivatives: Sequence[Node], i: int, j: int) -> Node:
        """dY_i/dx_j among the results of the slope."""
        return derivatives[i * self.entries + j]

    def slope_index(self, k: int) -> tuple[int, int, Fraction]:
        """Result k of the slope is dY_i/dx_j times a number: i, j and the number."""
        return (*divmod(k, self.entries), Fraction(1))

    def by_externals(self, g: Graph) -> Mapping[int, TensorFunction]:
        """Derivatives of the function by external values, where they are not zero."""
        return {}

    def partials(
        self, g: Graph, part: FunctionPart, args: Sequence[Node], k: int
    ) -> list[tuple[Node, Node]]:
        """Derivatives of result k of a part by the operands."""
        n = self.entries
        x, fixed, p = args[:n], args[: n + self.externals], args[n + self.externals :]
        pairs = []
        if part is FunctionPart.VALUE:
            derivatives = self.run(g, FunctionPart.SLOPE, fixed)
            pairs += [(x[j], self.slope(g, derivatives, k, j)) for j in range(n)]
        elif part is FunctionPart.ADJOINT:
            derivatives = self.run(g, FunctionPart.SLOPE, fixed)
            curvature = self.run(g, FunctionPart.CURVATURE, args)
            pairs += [(x[j], curvature[_upper(n, k, j)]) for j in range(n)]
            pairs += [(q, self.slope(g, derivatives, i, k)) for i, q in enumerate(p)]
        elif part is FunctionPart.SLOPE:
            i, j, factor = self.slope_index(k)
            curvature = self._curvature_of(g, fixed, i)
            scaled = g.const(factor)
            pairs += [(x[m], g.mul(scaled, curvature[_upper(n, j, m)])) for m in range(n)]
        else:
            if any(a.op not in (Op.CONST, Op.PI) for a in x):
                raise DifferentiationError(
                    f"a third derivative of {self.what} is needed; there are two. A derivative of "
                    "it (m.derivative) may enter a weak form or a field, not a potential"
                )
            pairs += [(q, self._curvature_of(g, fixed, i)[k]) for i, q in enumerate(p)]
        for j, by in self.by_externals(g).items():
            pairs.append((args[n + j], by.run(g, part, args)[k]))
        return pairs

    def _curvature_of(self, g: Graph, fixed: Sequence[Node], i: int) -> Nodes:
        """Second derivatives of result i alone."""
        unit = [g.one if m == i else g.zero for m in range(self.results)]
        return self.run(g, FunctionPart.CURVATURE, [*fixed, *unit])

    def lowered(self, g: Graph, part: FunctionPart, args: Sequence[Node]) -> Nodes:
        """Results of a part in nodes and routines that are printed."""
        n = self.entries
        fixed, p = args[: n + self.externals], args[n + self.externals :]
        if part is not FunctionPart.ADJOINT:
            return self.printed(g, part, fixed, p)
        derivatives = self.printed(g, FunctionPart.SLOPE, fixed, ())
        totals = []
        for j in range(n):
            total = g.zero
            for i, q in enumerate(p):
                total = g.add(total, g.mul(q, self.slope(g, derivatives, i, j)))
            totals.append(total)
        return totals

    @abstractmethod
    def printed(
        self, g: Graph, part: FunctionPart, fixed: Sequence[Node], p: Sequence[Node]
    ) -> Nodes:
        """The value, the slope or the curvature in nodes and routines that are printed."""


def _upper(n: int, i: int, j: int) -> int:
    """Position of entry (i, j) in the upper triangle of a symmetric n x n matrix, row by row."""
    i, j = min(i, j), max(i, j)
    return i * n - i * (i - 1) // 2 + j - i


def entry_pairs(size: int) -> list[tuple[int, int]]:
    """Order of the independent entries of a symmetric matrix: the diagonal first."""
    diagonal = [(i, i) for i in range(size)]
    return diagonal + [(i, j) for i in range(size) for j in range(i + 1, size)]


# ----------------------------------------------------------------------------- printed routines


class KernelKind(StrEnum):
    """Printed routines; operands and results are those of `emit.tensor_routines`."""

    EIGEN = "eigen"
    SUM = "spectral_value"
    SLOPE = "spectral_slope"
    CURVATURE = "spectral_curvature"
    BENDING = "eigenvalue_curvature"
    EXP = "exponential"
    EXP_SLOPE = "exponential_slope"
    EXP_CURVATURE = "exponential_curvature"


@dataclass(frozen=True, eq=False)
class MatrixKernel(Routine):
    """A printed routine of matrices of `size` rows, without derivatives."""

    kind: KernelKind
    size: int

    def partials(self, g: Graph, item: Node) -> list[tuple[Node, Node]]:
        raise AssertionError(f"{self.name} is made after all derivatives are taken")


def _kernels(size: int) -> dict[tuple[KernelKind, int], MatrixKernel]:
    n, full = size, size * size
    entries = n * (n + 1) // 2
    pairs, triples = entries - n, n * (n - 1) * (n - 2) // 6
    triangle = entries * (entries + 1) // 2
    table = {
        KernelKind.EIGEN: (entries, n + full),
        KernelKind.SUM: (n + full, entries),
        KernelKind.SLOPE: (entries + full, triangle),
        KernelKind.CURVATURE: (n + 2 * pairs + triples + full + entries, triangle),
        KernelKind.BENDING: (n + full + n, triangle),
        KernelKind.EXP: (full, full),
        KernelKind.EXP_SLOPE: (full, full * full),
        KernelKind.EXP_CURVATURE: (2 * full, full * (full + 1) // 2),
    }
    return {(k, n): MatrixKernel(f"{k}_{n}", *counts, k, n) for k, counts in table.items()}


KERNELS = {**_kernels(2), **_kernels(3)}


# ------------------------------------------------------------------- f of a symmetric matrix


@dataclass(eq=False)
class IsotropicFunction(TensorFunction):
    """sum of f(c_a) n_a n_a of a symmetric matrix with eigenvalues c_a and vectors n_a.

    f: a node of the input `local` 0, the eigenvalue, and of `external` ones.
    """

    f: Node | None = None
    _by_externals: dict[int, TensorFunction] = field(default_factory=dict)
    _differences: list[Node] = field(default_factory=list)

    @property
    def slope_count(self) -> int:
        return self.entries * (self.entries + 1) // 2

    def _multiplicity(self, j: int) -> int:
        return 1 if j < self.size else 2

    def slope(self, g: Graph, derivatives: Sequence[Node], i: int, j: int) -> Node:
        value = derivatives[_upper(self.entries, i, j)]
        return g.mul(g.const(self._multiplicity(j)), value)

    def slope_index(self, k: int) -> tuple[int, int, Fraction]:
        n = self.entries
        i, j = next((i, j) for i in range(n) for j in range(i, n) if _upper(n, i, j) == k)
        return i, j, Fraction(1, self._multiplicity(j))

    def by_externals(self, g: Graph) -> Mapping[int, TensorFunction]:
        assert self.f is not None
        if self.externals and not self._by_externals:
            sources = [g.input("external", j) for j in range(self.externals)]
            for j, slope in enumerate(map(gradient(g, self.f, sources).__getitem__, sources)):
                if slope is not g.zero:
                    self._by_externals[j] = IsotropicFunction(
                        f"{self.name}_by_{j}", self.what, self.size, self.externals, f=slope
                    )
        return self._by_externals

    def printed(
        self, g: Graph, part: FunctionPart, fixed: Sequence[Node], p: Sequence[Node]
    ) -> Nodes:
        n, size = self.entries, self.size
        eigen = g.run(KERNELS[KernelKind.EIGEN, size], fixed[:n])
        c, Q, external = eigen[:size], eigen[size:], fixed[n:]
        f, slope, second, divided, twice = self.differences(g)

        def at(node: Node, *which: int) -> Node:
            lifted = lift_inputs(g, [node], [c[a] for a in which], external)
            return _ordered_quotients(g, lifted)[0]

        pairs = [(a, b) for a in range(size) for b in range(a + 1, size)]
        if part is FunctionPart.VALUE:
            return g.run(KERNELS[KernelKind.SUM, size], [*(at(f, a) for a in range(size)), *Q])
        if part is FunctionPart.SLOPE:
            first = [at(slope, a) for a in range(size)] + [at(divided, a, b) for a, b in pairs]
            return g.run(KERNELS[KernelKind.SLOPE, size], [*first, *Q])
        # f[x, y, z] is that of f[x, z] between x and y: these are the two farthest apart
        higher = [at(second, a) for a in range(size)]
        higher += [at(twice, *which) for a, b in pairs for which in ((a, b, a), (b, a, b))]
        if size == 3:
            higher.append(at(twice, 0, 2, 1))
        return g.run(KERNELS[KernelKind.CURVATURE, size], [*higher, *Q, *p])

    def differences(self, g: Graph) -> list[Node]:
        """f(x), f'(x), f''(x) / 2, f[x, y] and f[x, y, z] as functions of the inputs `local`.

        f[x, y, z] is the divided difference of f[x, z] between x and y.
        """
        if not self._differences:
            assert self.f is not None
            x, y, z = (g.input("local", k) for k in range(3))
            slope = gradient(g, self.f, [x])[x]
            second = g.mul(g.const(Fraction(1, 2)), gradient(g, slope, [x])[x])
            divided = divided_difference(g, self.f, x, y)
            twice = divided_difference(g, divided_difference(g, self.f, x, z), x, y)
            self._differences = [self.f, slope, second, divided, twice]
        return self._differences


def _ordered_quotients(g: Graph, roots: Sequence[Node]) -> Nodes:
    """Quotients of functions with operands in one order; of equal ones they are derivatives."""

    def rule(g: Graph, n: Node, args: tuple[Node, ...]) -> Node:
        call = args[0] if n.op is Op.ITEM else n
        if not isinstance(call.payload, Quotient) or call.payload.op is Op.ATAN2:
            return g.rebuild(n.op, args, n.payload)
        if n.op is Op.ITEM:
            u, v, f_u, *_ = call.args
            return partials(g, f_u)[0][1] if u is v else g.node(n.op, args, n.payload)
        u, v, f_u, f_v, *exponent = args
        if v.id < u.id:
            u, v, f_u, f_v = v, u, f_v, f_u
        return g.node(n.op, (u, v, f_u, f_v, *exponent), n.payload)

    return rewrite(g, roots, rule)


def divided_difference(g: Graph, f: Node, x: Node, y: Node) -> Node:
    """(f(x) - f(y)) / (x - y), where y takes the place of x."""
    gap = g.sub(x, y)
    return Divided(g, {x: y}, gap, {x: g.one}, nearly_equal(g, x, y))(f)


@dataclass(eq=False)
class Eigenvalues(TensorFunction):
    """Eigenvalues of a symmetric matrix, the largest first.

    Where two are equal, the part of the second derivatives that is divided by their distance is 0.
    """

    @property
    def results(self) -> int:
        return self.size

    def printed(
        self, g: Graph, part: FunctionPart, fixed: Sequence[Node], p: Sequence[Node]
    ) -> Nodes:
        n = self.size
        eigen = g.run(KERNELS[KernelKind.EIGEN, n], fixed)
        c, Q = eigen[:n], eigen[n:]
        if part is FunctionPart.VALUE:
            return c
        if part is FunctionPart.CURVATURE:
            return g.run(KERNELS[KernelKind.BENDING, n], [*c, *Q, *p])
        derivatives = []
        for a in range(n):
            for i, j in entry_pairs(n):
                product = g.mul(Q[n * i + a], Q[n * j + a])
                derivatives.append(product if i == j else g.mul(g.const(2), product))
        return derivatives


@dataclass(eq=False)
class Exponential(TensorFunction):
    """Exponential function of a matrix that need not be symmetric, row by row."""

    @property
    def entries(self) -> int:
        return self.size * self.size

    def printed(
        self, g: Graph, part: FunctionPart, fixed: Sequence[Node], p: Sequence[Node]
    ) -> Nodes:
        kinds = {
            FunctionPart.VALUE: KernelKind.EXP,
            FunctionPart.SLOPE: KernelKind.EXP_SLOPE,
            FunctionPart.CURVATURE: KernelKind.EXP_CURVATURE,
        }
        return g.run(KERNELS[kinds[part], self.size], [*fixed, *p])


# -------------------------------------------------------------------------------------- lowering


def lower(g: Graph, roots: Sequence[Node]) -> list[Node]:
    """Tensor functions in nodes and routines that are printed."""
    results: dict[Node, Nodes] = {}

    def rule(g: Graph, n: Node, args: tuple[Node, ...]) -> Node:
        if n.op is Op.CALL and isinstance(n.payload, TensorRoutine):
            call = g.node(n.op, args, n.payload)
            if call not in results:
                results[call] = n.payload.function.lowered(g, n.payload.part, args)
            return call
        if n.op is Op.ITEM and args[0] in results:
            assert isinstance(n.payload, ResultIndex)
            return results[args[0]][n.payload.index]
        return g.rebuild(n.op, args, n.payload)

    return rewrite(g, roots, rule)

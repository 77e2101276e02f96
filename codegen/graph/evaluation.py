"""Values of an unoptimised graph in arbitrary precision: the walk of the oracle.

Routines have values of their own here, without their derivatives and their C: local unknowns are
found by Newton's method with differences for slopes; derivatives of functions of stretches are
differences of the function of the matrix.
"""

from __future__ import annotations

import random
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import mpmath
from mpmath.libmp import NoConvergence

from softehl.codegen.graph import matrix_functions
from softehl.codegen.graph.bessel import Bessel
from softehl.codegen.graph.graph import InputEntry, Node, Op, ResultIndex, Routine
from softehl.codegen.graph.precise_arithmetic import arctangent, number
from softehl.codegen.graph.routines import (
    HIGHEST_OF_STRETCHES,
    TRIPLES,
    External,
    Inverse,
    Isotropic,
    NewtonRoutine,
    depends,
)
from softehl.codegen.graph.run_time_arrays import ArrayRoutine
from softehl.codegen.graph.tensor_functions import (
    Eigenvalues,
    Exponential,
    FunctionPart,
    TensorFunction,
    TensorRoutine,
    entry_pairs,
)
from softehl.codegen.graph.tensor_functions import IsotropicFunction as TensorIsotropic
from softehl.codegen.graph.term_reductions import Reduction, TermsLayout
from softehl.codegen.graph.traversal import Recursion, reachable, recursion

Number = Any
Vector = list[Number]
Evaluate = Callable[[Sequence[Node], Vector, Vector], Vector]


def results(r: Routine, args: Vector, evaluate: Evaluate) -> Vector:
    """Results of a routine in the working precision of mpmath; not-a-number where it has none."""
    match r:
        case NewtonRoutine():
            return _newton(r, args, evaluate)
        case Inverse():
            inverted = mpmath.matrix(r.size, r.size)
            for k, a in enumerate(args):
                inverted[k // r.size, k % r.size] = a
            inverted = inverted**-1
            return [inverted[i, j] for i in range(r.size) for j in range(r.size)]
        case Isotropic():
            return _isotropic(r, args, evaluate)
        case External():
            x = args[r.inputs - r.function.inputs :]
            values = r.function.near(x, mpmath.mpf, r.order)
            return [mpmath.nan] * r.outputs if values is None else values
        case ArrayRoutine():  # of any array, where none is given
            return _of_array(r, exact(r.layout.sample(random.Random(r.name))), (), args)
        case Bessel():
            scale = mpmath.fac2(2 * r.order + 1)
            square = mpmath.fsum(a**2 for a in args)
            return [mpmath.hyp0f1(r.order + mpmath.mpf(3) / 2, -square / 4) / scale]
        case TensorRoutine():
            return _tensor(r, args, evaluate)
    raise TypeError(f"no value for {r}")


def _of_array(r: ArrayRoutine, array: Vector, rate: Sequence[Number], args: Vector) -> Vector:
    h = mpmath.mpf(10) ** (-mpmath.mp.dps // 4)
    functions = {"exp": mpmath.exp, "log": mpmath.log, "tanh": mpmath.tanh, "step": lambda _: h}
    return r.results(array, rate, args, functions)


def _newton(r: NewtonRoutine, args: Vector, evaluate: Evaluate) -> Vector:
    p, s = args[: r.inputs - r.outputs], args[r.inputs - r.outputs :]
    previous, A = mpmath.inf, None
    for _ in range(200):
        A = A or _jacobian(r, s, p, evaluate)
        try:
            step = mpmath.lu_solve(A, mpmath.matrix(evaluate(r.equations, s, p)))
        except ZeroDivisionError:
            break
        s = [v - step[i] for i, v in enumerate(s)]
        digits = mpmath.mpf(10) ** (8 - mpmath.mp.dps)
        changes = [abs(v) for v in step]
        converged = all(c <= digits * abs(v) for c, v in zip(changes, s, strict=True))
        if converged or digits * max(1, *map(abs, s)) >= max(changes) > previous / 2:
            return s  # to its own digits, or to those that rounding leaves
        previous = max(changes)
        if previous > _CLOSE * max(map(abs, s)):  # else these slopes give eight digits a step
            A = None
    return [mpmath.nan] * len(s)


_CLOSE = 1e-8


def _jacobian(r: NewtonRoutine, s: Vector, p: Vector, evaluate: Evaluate) -> mpmath.matrix:
    """dg/ds by differences."""
    h = mpmath.mpf(10) ** (-mpmath.mp.dps // 3)
    A = mpmath.matrix(len(s), len(s))
    for j in range(len(s)):
        plus, minus = (
            evaluate(r.equations, [v + t * h * (i == j) for i, v in enumerate(s)], p)
            for t in (1, -1)
        )
        for i in range(len(s)):
            A[i, j] = (plus[i] - minus[i]) / (2 * h)
    return A


def _isotropic(r: Isotropic, args: Vector, evaluate: Evaluate) -> Vector:
    h = mpmath.mpf(10) ** (-mpmath.mp.dps // 4)

    def derivative(entries: Vector, path: tuple[int, ...]) -> Number:
        if not path:
            return _energy(r, [*entries, *args[6:]], evaluate)
        plus, minus = (
            derivative([v + t * h * (i == path[0]) for i, v in enumerate(entries)], path[1:])
            for t in (1, -1)
        )
        return (plus - minus) / (2 * h)

    paths: list[tuple[int, ...]] = [()]
    if r.order == 1:
        paths = [(i,) for i in range(6)]
    elif r.order == 2:
        paths = [(i, j) for i in range(6) for j in range(i, 6)]
    elif r.order == HIGHEST_OF_STRETCHES:
        paths = [*TRIPLES]
    return [derivative(args[:6], path) for path in paths]


def _energy(r: Isotropic, args: Vector, evaluate: Evaluate) -> Number:
    a, b, c, d, e, f = args[:6]
    eigenvalues = mpmath.eigsy(mpmath.matrix([[a, d, e], [d, b, f], [e, f, c]]), eigvals_only=True)
    return evaluate([r.energy], list(eigenvalues), args[6:])[0]


def _tensor(r: TensorRoutine, args: Vector, evaluate: Evaluate) -> Vector:
    """A part of a tensor function: its derivatives are differences of its value."""
    f = r.function
    n = f.entries
    external = args[n : n + f.externals]
    digits = mpmath.mp.dps
    if r.part is not FunctionPart.VALUE:
        with mpmath.workdps(3 * digits):
            return _tensor_derivative(r, args, evaluate, mpmath.mpf(10) ** (-3 * digits // 4))
    return _tensor_value(f, args[:n], external, evaluate)


def _tensor_derivative(r: TensorRoutine, args: Vector, evaluate: Evaluate, h: Number) -> Vector:
    """Central differences, in so many digits that they have those of the caller."""
    f = r.function
    n = f.entries
    external, p = args[n : n + f.externals], args[n + f.externals :]

    def value(x: Vector) -> Vector:
        return _tensor_value(f, x, external, evaluate)

    def rate(x: Vector, j: int, of: Callable[[Vector], Vector]) -> Vector:
        plus, minus = (of([v + t * h * (k == j) for k, v in enumerate(x)]) for t in (1, -1))
        return [(a - b) / (2 * h) for a, b in zip(plus, minus, strict=True)]

    x = args[:n]
    if r.part is FunctionPart.CURVATURE:
        along = [partial(rate, j=j, of=value) for j in range(n)]
        return [mpmath.fdot(p, rate(x, i, along[j])) for i in range(n) for j in range(i, n)]
    derivatives = [rate(x, j, value) for j in range(n)]
    if r.part is FunctionPart.ADJOINT:
        return [mpmath.fdot(p, column) for column in derivatives]
    results = []
    for k in range(f.slope_count):
        i, j, factor = f.slope_index(k)
        results.append(derivatives[j][i] * factor.numerator / factor.denominator)
    return results


def _tensor_value(f: TensorFunction, x: Vector, external: Vector, evaluate: Evaluate) -> Vector:
    n = f.size
    if isinstance(f, Exponential):
        return matrix_functions.exponential(x)
    pairs = entry_pairs(n)
    full = [x[pairs.index((min(i, j), max(i, j)))] for i in range(n) for j in range(n)]
    c, Q = matrix_functions.eigenvectors(full, mpmath.sqrt)
    if isinstance(f, Eigenvalues):
        return sorted(c, reverse=True)
    assert isinstance(f, TensorIsotropic)
    assert f.f is not None
    at = [evaluate([f.f], [a], external)[0] for a in c]
    return [mpmath.fsum(v * Q[i][a] * Q[j][a] for a, v in enumerate(at)) for i, j in pairs]


def symmetric(value: Node, unknowns: Sequence[Node]) -> bool:
    """True when `value` does not change under exchanges of `unknowns`.

    It is compared at random points between 1/64 and 64, where a function that is one-sided far
    from 1 shows it; points without a real value are left out.
    """
    rng = random.Random(0)
    inside = depends([value], unknowns)
    leaves = (Op.INPUT, Op.SUM, Op.ITEM)
    inputs = [n for n in reachable([value]) if n.op in leaves and n not in inside]
    with mpmath.workdps(30):
        for width in (0.5, 2, 4, 6, 6, 6, 6, 6):
            point = [mpmath.mpf(2) ** rng.uniform(-width, width) for _ in unknowns]
            at = {n: mpmath.mpf(2) ** rng.uniform(-width, width) for n in inputs}
            turns = [list(reversed(point))]
            turns += [[*point[k:], *point[:k]] for k in range(len(unknowns))]
            values = [
                _value_at(value, {**at, **dict(zip(unknowns, t, strict=True))}) for t in turns
            ]
            if any(v is None for v in values):
                if any(v is not None for v in values):
                    return False
            elif any(abs(v - values[0]) > 1e-20 * (1 + abs(values[0])) for v in values):
                return False
    return True


def alike(a: Node, b: Node) -> bool:
    """True when two values are equal at random values of all that enters them."""
    rng = random.Random(1)
    leaves = [n for n in reachable([a, b]) if n.op in (Op.INPUT, Op.SUM, Op.ITEM)]
    with mpmath.workdps(30):
        at = {n: mpmath.mpf(rng.uniform(-1, 1)) for n in leaves}
        one, other = _value_at(a, dict(at)), _value_at(b, dict(at))
        return None in (one, other) or abs(one - other) <= 1e-20 * (1 + abs(one))


def _value_at(value: Node, at: dict[Node, Any]) -> Any:
    """A value from those of the inputs; None where it is not real."""
    for n in reachable([value], stop=at.__contains__):
        if n not in at:
            try:
                at[n] = _operation(n, [at[a] for a in n.args])
            except (ArithmeticError, TypeError, ValueError, NoConvergence):
                return None
    real = not isinstance(at[value], mpmath.mpc) and not mpmath.isnan(at[value])
    return at[value] if real else None


def _operation(n: Node, args: Vector) -> Any:
    if n.op is Op.ITEM:
        assert isinstance(n.payload, ResultIndex)
        return args[0][n.payload.index]
    if n.op is Op.CALL:
        assert isinstance(n.payload, Routine)
        return results(n.payload, args, _localised)
    return number(n, args)


def _localised(values: Sequence[Node], local: Vector, external: Vector) -> Vector:
    """Values of a routine from its arguments."""
    at: dict[Node, Any] = {}
    arrays = {"local": local, "external": external}
    nodes = []
    for n in reachable(values):
        if n.op is Op.INPUT:
            assert isinstance(n.payload, InputEntry)
            at[n] = arrays[n.payload.array][n.payload.index]
    for value in values:
        nodes.append(_value_at(value, at))
        if nodes[-1] is None:
            raise ValueError("a local equation has no real value")
    return nodes


_UNARY: dict[Op, Callable[[Number], Number]] = {
    Op.NAME: lambda a: a,
    Op.NEG: lambda a: -a,
    Op.RECIP: lambda a: 1 / a,
    Op.SQRT: mpmath.sqrt,
    Op.CBRT: mpmath.cbrt,
    Op.RCBRT: lambda a: 1 / mpmath.cbrt(a),
    Op.LOG: mpmath.log,
    Op.EXP: mpmath.exp,
    Op.SIN: mpmath.sin,
    Op.COS: mpmath.cos,
    Op.TAN: lambda a: mpmath.sin(a) / mpmath.cos(a),
    Op.ASIN: mpmath.asin,
    Op.ACOS: mpmath.acos,
    Op.ATAN: mpmath.atan,
    Op.SINH: lambda a: (mpmath.exp(a) - mpmath.exp(-a)) / 2,
    Op.COSH: lambda a: (mpmath.exp(a) + mpmath.exp(-a)) / 2,
    Op.TANH: mpmath.tanh,
    Op.ASINH: mpmath.asinh,
    Op.ACOSH: mpmath.acosh,
    Op.ATANH: mpmath.atanh,
    Op.ERF: mpmath.erf,
    Op.ERFC: mpmath.erfc,
    Op.NOT: lambda a: not a,
}
_BINARY: dict[Op, Callable[[Number, Number], Number]] = {
    Op.ATAN2: arctangent,
    Op.POWER: lambda a, e: a**e,
    Op.ADD: lambda a, b: a + b,
    Op.SUB: lambda a, b: a - b,
    Op.MUL: lambda a, b: a * b,
    Op.LT: lambda a, b: a < b,
    Op.LE: lambda a, b: a <= b,
    Op.EQ: lambda a, b: a == b,
    Op.AND: lambda a, b: a and b,
    Op.OR: lambda a, b: a or b,
}


@dataclass(frozen=True)
class EvaluationState:
    """Arguments of one element: exact numbers, as doubles or mpmath values.

    `rule` holds rows (coordinates..., weight); `basis` [point][mode] = (value, xi-derivative)
    of each field; `point_data` [point][entry]; `arrays` those of any length, `array_rates` how they
    move along a variation; `term_history` [point][variable][term].
    """

    coordinates: Sequence[Number]
    dofs: Sequence[Number]
    data: Sequence[Number] = ()
    parameters: Sequence[Number] = ()
    rule: Sequence[Sequence[Number]] = ((1,),)
    basis: Sequence[Sequence[Sequence[Number]]] = ()
    point_data: Sequence[Sequence[Number]] = ()
    arrays: Sequence[Sequence[Number]] = ()
    term_history: Sequence[Sequence[Sequence[Number]]] = ()
    array_rates: Sequence[Sequence[Number]] = ()


class Walk:
    """One evaluation; values are remembered per node and point."""

    def __init__(
        self,
        state: EvaluationState,
        frozen: Mapping[tuple[Node, int], Number],
        dofs: Vector | None = None,
    ) -> None:
        self.state = state
        self.frozen = frozen
        self.arrays: dict[str, Vector] = {
            "coordinates": exact(state.coordinates),
            "dofs": exact(state.dofs) if dofs is None else dofs,
            "data": exact(state.data),
            "parameters": exact(state.parameters),
            "arrays": [mpmath.mpf(0)] * len(state.arrays),
            "term history": [mpmath.mpf(0) for row in state.term_history[:1] for _ in row],
        }
        self.memo: dict[tuple[Node, int], Number] = {}

    def value(self, n: Node) -> Number:
        """Value of a node that does not vary with the point."""
        return self.at(n, 0)

    def at(self, n: Node, q: int) -> Number:
        """Value of a node at point `q`."""
        return recursion(self._at(n, q))

    def _at(self, n: Node, q: int) -> Recursion[Number]:
        q = q if n.varying else 0
        key = (n, q)
        if key in self.frozen:
            return self.frozen[key]
        if key not in self.memo:
            self.memo[key] = yield self._compute(n, q)
        return self.memo[key]

    def _compute(self, n: Node, q: int) -> Recursion[Number]:
        match n.op:
            case Op.CONST:
                return mpmath.mpf(n.value.numerator) / n.value.denominator
            case Op.PI:
                return +mpmath.pi
            case Op.INPUT:
                assert isinstance(n.payload, InputEntry)
                return self._input(n.payload, q)
            case Op.SUM:
                terms = []
                for k in range(len(self.state.rule)):
                    terms.append((yield self._at(n.args[0], k)))
                return mpmath.fsum(terms)
            case Op.BRANCH:
                condition = yield self._at(n.args[0], q)
                return (yield self._at(n.args[1 if condition else 2], q))
            case Op.CALL:
                assert isinstance(n.payload, Routine)
                operands = []
                for a in n.args:
                    operands.append((yield self._at(a, q)))
                return self._results(n.payload, operands, q)
            case Op.ITEM:
                assert isinstance(n.payload, ResultIndex)
                return (yield self._at(n.args[0], q))[n.payload.index]
            case Op.POW:
                e: Any = n.payload
                return (yield self._at(n.args[0], q)) ** (mpmath.mpf(e.numerator) / e.denominator)
        args = []
        for a in n.args:
            args.append((yield self._at(a, q)))
        return _UNARY[n.op](args[0]) if len(args) == 1 else _BINARY[n.op](args[0], args[1])

    def _results(self, r: Routine, operands: Vector, q: int) -> Vector:
        if isinstance(r, Reduction):
            return self._reduced(r, operands, q)
        if isinstance(r, ArrayRoutine) and self.state.arrays:
            rate = exact(self.state.array_rates[r.array]) if self.state.array_rates else ()
            return _of_array(r, exact(self.state.arrays[r.array]), rate, operands)
        return results(r, operands, partial(self._local, q=q))

    def _reduced(self, r: Reduction, operands: Vector, q: int) -> Vector:
        rates = self.state.array_rates or [()] * len(self.state.arrays)
        arrays: list[tuple[Vector, Vector]] = []
        for k in r.arrays:
            if k < 0:
                arrays.append((exact(self.state.term_history[q][-1 - k]), []))
            elif self.state.arrays:
                arrays.append((exact(self.state.arrays[k]), exact(rates[k])))
            else:  # of any arrays, where none are given
                arrays.append((exact(TermsLayout().sample(random.Random(k))), []))
        return r.results(r.graph, arrays, operands, partial(self._local, q=q))

    def _local(self, values: Sequence[Node], local: Vector, external: Vector, q: int = 0) -> Vector:
        """Localised values of a routine at a point."""
        history = self.state.term_history[q : q + 1]
        walk = Walk(replace(self.state, term_history=history), {})
        walk.arrays = {"local": local, "external": external}
        return [walk.value(n) for n in values]

    def _input(self, source: InputEntry, q: int) -> Number:
        if source.array == "rule":
            return mpmath.mpf(self.state.rule[q][source.index])
        if source.array == "point data":
            return mpmath.mpf(self.state.point_data[q][source.index])
        if source.array == "interpolated":
            modes = self.state.basis[q]
            unknowns = self.arrays["dofs"][-len(modes) :]
            return mpmath.fsum(
                mpmath.mpf(b[source.index]) * p for b, p in zip(modes, unknowns, strict=True)
            )
        return self.arrays[source.array][source.index]


def exact(values: Sequence[Number]) -> Vector:
    """Numbers of the working precision."""
    return [mpmath.mpf(v) for v in values]


def evaluate(root: Node, inputs: Mapping[tuple[str, int], Number], digits: int = 50) -> Number:
    """Value of a graph without loops, for the tests of passes and derivatives."""
    arrays: dict[str, Vector] = {}
    for n in reachable([root]):
        if isinstance(n.payload, InputEntry):
            column = arrays.setdefault(n.payload.array, [])
            column += [0] * (n.payload.index + 1 - len(column))
            column[n.payload.index] = inputs[n.payload.array, n.payload.index]
    with mpmath.workdps(digits):
        walk = Walk(EvaluationState((), ()), {})
        walk.arrays = {k: exact(v) for k, v in arrays.items()}
        return walk.value(root)

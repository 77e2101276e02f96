"""Arrays that a kernel gets at run time, of any length: their layouts, and routines that read them.

A page knows such an array by its name alone; its numbers are given with each call, the same for all
elements. `codegen.abi` says where they stand. A routine that reads an array has one more operand
than the mathematics, the amount of a variation of the array: at `amount` t the array is a + t da,
where da is its rate. Kernels run at t = 0; the derivative by t is that along da, so that the array
is differentiated by as any other argument.

A layout says what the numbers are. It evaluates the function that they define in any arithmetic,
for the checks of kernels; it shares nothing with the C of the routines.
"""

from __future__ import annotations

import random
from abc import abstractmethod
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from typing import Any, ClassVar

from softehl.codegen.graph.divided_difference import Divided
from softehl.codegen.graph.graph import Graph, Node, ResultIndex, Routine
from softehl.codegen.graph.guarded_products import guarded
from softehl.codegen.graph.partial_derivatives import DifferentiationError, Partials

Number = Any
Functions = Mapping[str, Callable[[Number], Number]]


@dataclass(frozen=True)
class ArrayLayout:
    """Meaning of the numbers of an array. kind: in a manifest; content: in a line."""

    kind: ClassVar[str]
    content: ClassVar[str] = "its numbers"

    @property
    def options(self) -> dict[str, Any]:
        """Facts that a caller needs besides the kind."""
        return {}

    @abstractmethod
    def sample(self, rng: random.Random) -> list[float]:
        """Numbers of a valid array, for checks of kernels."""

    def rate(self, rng: random.Random, array: Sequence[float]) -> list[float]:
        """A rate of an array, for checks of kernels."""
        return [rng.uniform(-1, 1) * abs(v) for v in array]

    @abstractmethod
    def value(self, array: Sequence[Number], args: Sequence[Number], f: Functions) -> Number:
        """Value of the function that an array defines. f: functions of the arithmetic by name."""


@dataclass(frozen=True)
class ArraySymbol:
    """An array of a kernel by name, with its meaning and its layout."""

    name: str
    meaning: str
    layout: ArrayLayout


@dataclass(frozen=True, eq=False)
class ArrayRoutine(Routine):
    """A routine that reads the run-time array of number `array`.

    Its last operand is the amount of the variation. rate: its results are derivatives by it.
    """

    array: int
    layout: ArrayLayout
    rate: bool

    def results(
        self, array: Sequence[Number], rate: Sequence[Number], args: Sequence[Number], f: Functions
    ) -> list[Number]:
        """Results in any arithmetic with functions f; rate: that of the array."""
        raise NotImplementedError


# ----------------------------------------------------------------------------------------- curves


@dataclass(frozen=True)
class TableLayout(ArrayLayout):
    """Piecewise cubic of one argument.

    The array has m knots, then m + 1 rows of four coefficients: before the first knot, between
    neighbours, behind the last. A row is a polynomial of the distance to the knot on its left, the
    first one of that to the first knot. Rows of not-a-number: the curve has no values there.
    """

    kind: ClassVar[str] = "table"
    content: ClassVar[str] = "knots, then rows of coefficients, as softehl.Table(x, y).numbers"
    interpolation: str = "linear"
    outside: str = "constant"

    @property
    def options(self) -> dict[str, Any]:
        """The defaults of a page, which the C does not know."""
        return {"interpolation": self.interpolation, "outside": self.outside}

    def sample(self, rng: random.Random) -> list[float]:
        """A cubic in every row, continuous, and lines outside; positive from 0 to 2."""
        knots = [0.25, 0.75, 1.0, 1.375, 2.0]
        rows = []
        value, slope = 1.0 + rng.uniform(0, 0.5), rng.uniform(0.1, 0.3)
        rows.append([value, slope, 0.0, 0.0])
        for a, b in pairwise(knots):
            c, e, h = rng.uniform(-0.2, 0.2), rng.uniform(-0.2, 0.2), b - a
            rows.append([value, slope, c, e])
            value, slope = (
                value + h * (slope + h * (c + h * e)),
                slope + h * (2 * c + 3 * h * e),
            )
        rows.append([value, slope, 0.0, 0.0])
        return [*knots, *(v for row in rows for v in row)]

    def rate(self, rng: random.Random, array: Sequence[float]) -> list[float]:
        """See `ArrayLayout`; knots stay."""
        count = (len(array) - 4) // 5
        return [0.0] * count + super().rate(rng, array[count:])

    def value(self, array: Sequence[Number], args: Sequence[Number], f: Functions) -> Number:
        """See `ArrayLayout`."""
        return self.derivatives(array, args[0])[0]

    def derivatives(self, array: Sequence[Number], t: Number) -> list[Number]:
        """Value and three derivatives."""
        count = (len(array) - 4) // 5
        row = _row(array[:count], t)
        d = t - array[max(row - 1, 0)]
        a, b, c, e = array[count + 4 * row : count + 4 * row + 4]
        slope, curvature = b + d * (2 * c + d * 3 * e), 2 * c + 6 * e * d
        return [a + d * (b + d * (c + d * e)), slope, curvature, 6 * e]


def _row(knots: Sequence[Number], t: Number) -> int:
    """Number of the row of coefficients at t."""
    if t < knots[0]:
        return 0
    if t > knots[-1]:
        return len(knots)
    return max(k for k in range(len(knots) - 1) if k == 0 or knots[k] <= t) + 1


@dataclass(frozen=True, eq=False)
class TableRoutine(ArrayRoutine):
    """Value and three derivatives of a curve; operands: argument, amount."""

    _family: dict[str, ArrayRoutine] = field(default_factory=dict)

    def partials(self, g: Graph, item: Node) -> Partials:
        """By the argument the next result; by the amount that of the rate."""
        call, k = item.args[0], _index(item)
        t, amount = call.args
        pairs = [(t, g.run(self, call.args)[k + 1])] if k < 3 else []
        if not self.rate:
            pairs.append((amount, g.run(self._family["rate"], call.args)[k]))
        return pairs

    def divided(self, between: Divided, call: Node) -> list[Node]:
        """Divided differences of the results, of pieces where the states lie in several."""
        g, (t, amount) = between.g, call.args
        quotient = self._family["rate quotient" if self.rate else "quotient"]
        args = (t, between.other[t], amount)
        return [guarded(g, between.rates[t], q) for q in g.run(quotient, args)]

    def results(
        self, array: Sequence[Number], rate: Sequence[Number], args: Sequence[Number], f: Functions
    ) -> list[Number]:
        """See `ArrayRoutine`."""
        assert isinstance(self.layout, TableLayout)
        count, (t, amount) = (len(array) - 4) // 5, args
        if self.rate:
            return self.layout.derivatives([*array[:count], *rate[count:]], t)
        moved = [a + amount * b for a, b in zip(array, rate or array, strict=True)]
        return self.layout.derivatives([*array[:count], *moved[count:]], t)


@dataclass(frozen=True, eq=False)
class TableQuotient(ArrayRoutine):
    """Divided differences of the value and three derivatives of a curve: operands u, v, amount."""


def table(name: str, array: int, layout: TableLayout) -> TableRoutine:
    """The routine of a curve."""
    family: dict[str, ArrayRoutine] = {}
    value = TableRoutine(name, 2, 4, array, layout, rate=False, _family=family)
    rate = TableRoutine(f"{name}_rate", 2, 4, array, layout, rate=True, _family=family)
    for key, routine in (("", value), ("rate", rate)):
        family[key] = routine
        label = f"divided_{routine.name}"
        quotient = TableQuotient(label, 3, 4, array, layout, rate=routine.rate)
        family[f"{key} quotient".strip()] = quotient
    return value


# --------------------------------------------------------------------------------------- networks

ACTIVATIONS = ("softplus", "softplus_squared", "tanh", "sigmoid")
"""Activations of networks: twice differentiable functions of one number."""


@dataclass(frozen=True)
class NetworkLayout(ArrayLayout):
    """Dense layers from `inputs` numbers to one; the last layer has no activation.

    The array has, layer by layer, the weights (to, from) row by row, the biases (to,), and, where
    `convex` and behind the first layer, weights (to, inputs) of the inputs. convex: the weights of
    hidden values are not negative, so that the result is convex in the inputs (Amos, Xu and Kolter
    2017) and, if monotone, increases with each of them: then no weight is negative.
    """

    kind: ClassVar[str] = "network"
    content: ClassVar[str] = "layer by layer the weights (to, from) row by row, then the biases"
    inputs: int
    layers: tuple[int, ...]
    activation: str
    convex: bool = False
    monotone: bool = False

    @property
    def options(self) -> dict[str, Any]:
        """Sizes and restrictions of the weights."""
        return {
            "inputs": self.inputs,
            "layers": list(self.layers),
            "activation": self.activation,
            "convex": self.convex,
            "monotone": self.monotone,
        }

    @property
    def shapes(self) -> list[tuple[int, int, bool]]:
        """Of every layer its width, that of the layer before, and whether it sees the inputs."""
        widths = [self.inputs, *self.layers, 1]
        return [(b, a, self.convex and k > 0) for k, (a, b) in enumerate(pairwise(widths))]

    @property
    def size(self) -> int:
        """Numbers of the array."""
        return sum(to * (1 + start + skip * self.inputs) for to, start, skip in self.shapes)

    def sample(self, rng: random.Random) -> list[float]:
        """Weights of the size that keeps values about 1."""
        numbers = []
        for to, start, skip in self.shapes:
            scale = start**-0.5
            low = 0.0 if self.convex else -scale
            numbers += [rng.uniform(low, scale) for _ in range(to * start)]
            numbers += [rng.uniform(-0.5, 0.5) for _ in range(to)]
            if skip:
                numbers += [rng.uniform(low, scale) for _ in range(to * self.inputs)]
        return numbers

    def value(self, array: Sequence[Number], args: Sequence[Number], f: Functions) -> Number:
        """See `ArrayLayout`."""
        values, remaining = list(args), list(array)
        for number, (to, start, skip) in enumerate(self.shapes):
            W, remaining = remaining[: to * start], remaining[to * start :]
            b, remaining = remaining[:to], remaining[to:]
            new = [
                b[i] + sum(w * h for w, h in zip(W[i * start :], values, strict=False))
                for i in range(to)
            ]
            if skip:
                V, remaining = remaining[: to * self.inputs], remaining[to * self.inputs :]
                for i in range(to):
                    new[i] += sum(v * x for v, x in zip(V[i * self.inputs :], args, strict=False))
            last = number == len(self.layers)
            values = new if last else [_activated(self.activation, z, f) for z in new]
        return values[0]


def _activated(name: str, z: Number, f: Functions) -> Number:
    one = f["exp"](z * 0)
    if name == "tanh":
        return f["tanh"](z)
    if name == "sigmoid":
        return one / (one + f["exp"](-z))
    plus = f["log"](one + f["exp"](z)) if z < 0 else z + f["log"](one + f["exp"](-z))
    return plus * plus if name == "softplus_squared" else plus


@dataclass(frozen=True, eq=False)
class Network(ArrayRoutine):
    """Value of a network (order 0), its slopes (1), or these and the upper triangle of its second
    derivatives, row by row (2); operands: inputs, amount.
    """

    order: int
    _family: dict[tuple[int, bool], Network] = field(default_factory=dict)

    def partials(self, g: Graph, item: Node) -> Partials:
        """By the inputs results of the next order; by the amount those of the rate."""
        call, k, n = item.args[0], _index(item), self.inputs - 1
        order = self.order if k >= n else min(self.order, 1)
        if order == 2 or (self.rate and order == 1):
            raise DifferentiationError(f"{self.name}: no third derivatives of a network")
        relative = self._family[order + 1, self.rate]
        raised = g.run(relative, call.args)
        by = raised[:n] if order == 0 else [raised[n + self._upper(k, j)] for j in range(n)]
        pairs = list(zip(call.args[:n], by, strict=True))
        if not self.rate:
            pairs.append((call.args[n], g.run(self._family[order, True], call.args)[k]))
        return pairs

    def _upper(self, i: int, j: int) -> int:
        i, j, n = min(i, j), max(i, j), self.inputs - 1
        return i * n - i * (i - 1) // 2 + j - i

    def divided(self, between: Divided, call: Node) -> list[Node]:
        """Refuse a network of single stretches."""
        raise DifferentiationError(
            f"{self.name}: a network in m.principal may see symmetric functions of the stretches "
            "only, such as invariants, not a stretch alone"
        )

    @property
    def higher(self) -> Network | None:
        """The routine whose first results are those of this one, if there is one."""
        return self._family[2, False] if self.order == 1 and not self.rate else None

    def results(
        self, array: Sequence[Number], rate: Sequence[Number], args: Sequence[Number], f: Functions
    ) -> list[Number]:
        """See `ArrayRoutine`; derivatives are differences, in an arithmetic of many digits."""
        n = self.inputs - 1
        x, amount, h = list(args[:n]), args[n], f["step"](args[0])

        def at(values: Sequence[Number], t: Number) -> Number:
            moved = [a + t * b for a, b in zip(array, rate, strict=True)] if rate else array
            return self.layout.value(moved, values, f)

        def along(function: Callable[[Number, Number], Number]) -> Number:
            return (function(x, amount + h) - function(x, amount - h)) / (2 * h)

        def slope(k: int, function: Callable[[Any, Number], Number]) -> Callable[[Any, Any], Any]:
            def difference(values: Sequence[Number], t: Number) -> Number:
                up, down = ([v + s * h * (i == k) for i, v in enumerate(values)] for s in (1, -1))
                return (function(up, t) - function(down, t)) / (2 * h)

            return difference

        functions = [at] if self.order == 0 else [slope(k, at) for k in range(n)]
        if self.order == 2:
            functions += [slope(j, slope(i, at)) for i in range(n) for j in range(i, n)]
        return [along(w) if self.rate else w(x, amount) for w in functions]


def network(name: str, array: int, layout: NetworkLayout) -> Network:
    """The routine of the value of a network."""
    n, family = layout.inputs, dict[tuple[int, bool], Network]()
    outputs = (1, n, n + n * (n + 1) // 2)
    for order, rate in ((0, False), (1, False), (2, False), (0, True), (1, True)):
        label = f"{name}_{order}" + ("_rate" if rate else "")
        family[order, rate] = Network(
            label, n + 1, outputs[order], array, layout, rate, order, family
        )
    return family[0, False]


def _index(item: Node) -> int:
    assert isinstance(item.payload, ResultIndex)
    return item.payload.index

"""C of routines that read run-time arrays: curves and networks.

The layers of a network are loops, so that the C does not grow with their widths. Second derivatives
by the inputs need no second sweep back: with the values h = a(z) of the hidden units and the
derivatives g of the result by them, they are the sum over all units of g a''(z) J J^T, where J are
the derivatives of z by the inputs.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

from softehl.codegen.abi import ARRAY_ENTRIES
from softehl.codegen.graph.graph import Routine
from softehl.codegen.graph.run_time_arrays import (
    ArrayRoutine,
    Network,
    NetworkLayout,
    TableQuotient,
    TableRoutine,
)
from softehl.codegen.language.definition import Definition


def single(d: Definition, r: ArrayRoutine, signature: str) -> list[str]:
    """C functions of a routine for one element, callees first."""
    match r:
        case TableRoutine():
            return [_ROW, _POLYNOMIAL, f"{signature}{{\n{_opened(d, r, 's', '0.0')}{_TABLE}}}\n"]
        case TableQuotient():
            return [_ROW, _POLYNOMIAL, f"{signature}{{\n{_opened(d, r, 's', '0.0')}{_QUOTIENT}}}\n"]
        case Network():
            return [*_support(r, _SINGLE), _network(d, r, signature, _SINGLE)]
    raise TypeError(f"no C for {r}")


def lanes(d: Definition, r: Routine, signature: str) -> list[str]:
    """C functions of a network for several elements at once, callees first."""
    assert isinstance(r, Network)
    return [*_support(r, _LANES), _network(d, r, signature, _LANES)]


def _opened(d: Definition, r: ArrayRoutine, results: str, zero: str) -> str:
    """The array a, and r, whose values are read: a itself or its rate. No rate is zero."""
    at = len(d.parameters) + ARRAY_ENTRIES * r.array
    lines = [f"const double *const a = parameters + (ptrdiff_t)parameters[{at}];"]
    if isinstance(r, TableRoutine | TableQuotient):
        lines.append(f"const ptrdiff_t m = ((ptrdiff_t)parameters[{at + 1}] - 4) / 5;")
    if r.rate:
        lines += [
            f"const double *const r = parameters + (ptrdiff_t)parameters[{at + 2}];",
            "if (r == parameters) {",
            f"    for (int k = 0; k < {r.outputs}; ++k) {results}[k] = {zero};",
            f"    return{' 0' if zero == '0.0' else ''};",
            "}",
        ]
    elif isinstance(r, TableRoutine | TableQuotient):
        lines.append("const double *const r = a;")
    return "".join(f"    {line}\n" for line in lines)


_ROW = """/* Row of coefficients of a table of m knots x at t: 0 before the first, m behind all. */
static ptrdiff_t softehl_table_row(ptrdiff_t m, const double *x, double t)
{
    if (t < x[0]) return 0;
    if (t > x[m - 1]) return m;
    ptrdiff_t low = 0, high = m - 1;
    while (high - low > 1) {
        const ptrdiff_t middle = (low + high) / 2;
        if (x[middle] <= t) low = middle;
        else high = middle;
    }
    return low + 1;
}
"""

_POLYNOMIAL = """/* Value and three derivatives of a cubic. */
static void softehl_cubic(const double *c, double d, double *s)
{
    s[0] = c[0] + d * (c[1] + d * (c[2] + d * c[3]));
    s[1] = c[1] + d * (2.0 * c[2] + d * 3.0 * c[3]);
    s[2] = 2.0 * c[2] + 6.0 * d * c[3];
    s[3] = 6.0 * c[3];
}
"""

_TABLE = """    const ptrdiff_t row = softehl_table_row(m, a, p[0]);
    softehl_cubic(r + m + 4 * row, p[0] - a[row > 0 ? row - 1 : 0], s);
    return s[0] != s[0];
"""

_QUOTIENT = """    const double u = p[0] > p[1] ? p[0] : p[1], v = p[0] > p[1] ? p[1] : p[0];
    const ptrdiff_t first = softehl_table_row(m, a, v), last = softehl_table_row(m, a, u);
    double end[4], start[4];
    for (int k = 0; k < 4; ++k) s[k] = 0.0;
    for (ptrdiff_t row = first; row <= last; ++row) {
        const double *const c = r + m + 4 * row, x = a[row > 0 ? row - 1 : 0];
        const double d = (row == last ? u : a[row]) - x, e = (row == first ? v : x) - x;
        const double part = first == last ? 1.0 : (d - e) / (u - v);
        s[0] += part * (c[1] + c[2] * (d + e) + c[3] * (d * d + d * e + e * e));
        s[1] += part * (2.0 * c[2] + 3.0 * c[3] * (d + e));
        s[2] += part * 6.0 * c[3];
        softehl_cubic(c, e, start);
        for (int k = 0; row > first && k < 4; ++k) {
            const double jump = start[k] - end[k], size = fabs(start[k]) + fabs(end[k]);
            if (fabs(jump) > 1e-12 * size) s[k] += jump / (u - v);
        }
        softehl_cubic(c, d, end);
    }
    return s[0] != s[0];
"""


# --------------------------------------------------------------------------------------- networks


@dataclass(frozen=True)
class _Kind:
    """Words of C for values of one element or of several."""

    type: str
    suffix: str
    splat: str
    exp: str
    abs: str
    select: str
    """Of a < b, then two values."""

    def written(self, text: str) -> str:
        """A text with these words."""
        for word, value in (
            ("@T", self.type),
            ("@S", self.suffix),
            ("@splat", self.splat),
            ("@exp", self.exp),
            ("@abs", self.abs),
        ):
            text = text.replace(word, value)
        return text


_SINGLE = _Kind("double", "_1", "", "exp", "fabs", "({} < {} ? {} : {})")
_LANES = _Kind(
    *("V", "_n", "softehl_splat", "softehl_vexp", "softehl_vfabs"),
    "softehl_blend(softehl_lt({}, {}), {}, {})",
)

ROWS = 8
"""Sums of a product with weights that are formed at once: as many as the latency of one needs."""


def _dense() -> str:
    """z += W h and h += W^T z of n rows of m weights, several sums at once."""
    sums = range(ROWS)

    def block(count: str, head: str, inner: str, weight: str, source: str, to: str) -> str:
        declared = ", ".join(f"s{k} = {to}[{head} + {k}]" for k in sums)
        added = " ".join(f"s{k} += {weight.format(k=k)} * {source};" for k in sums)
        stored = " ".join(f"{to}[{head} + {k}] = s{k};" for k in sums)
        return (
            f"    for (; {head} + {ROWS} <= {count}; {head} += {ROWS}) {{\n"
            f"        @T {declared};\n"
            f"        for ({inner}) {{\n            const @T v = {source};\n"
            f"            {added.replace(source, 'v')}\n        }}\n        {stored}\n    }}\n"
        )

    forth = block("n", "i", "int j = 0; j < m; ++j", "W[(i + {k}) * m + j]", "h[j]", "z")
    back = block("m", "j", "int i = 0; i < n; ++i", "W[i * m + j + {k}]", "z[i]", "h")
    return (
        "/* z += W h of n rows of m weights. */\n"
        "static void softehl_dense@S(int n, int m, const double *W, const @T *h, @T *z)\n"
        f"{{\n    int i = 0;\n{forth}"
        "    for (; i < n; ++i)\n"
        "        for (int j = 0; j < m; ++j) z[i] += W[i * m + j] * h[j];\n}\n\n"
        "/* h += W^T z. */\n"
        "static inline void softehl_dense_back@S(\n"
        "    int n, int m, const double *W, const @T *z, @T *h)\n"
        f"{{\n    int j = 0;\n{back}"
        "    for (; j < m; ++j)\n"
        "        for (int i = 0; i < n; ++i) h[j] += W[i * m + j] * z[i];\n}\n\n"
        "static inline void softehl_copy@S(int n, const double *b, @T *z)\n"
        "{\n    for (int i = 0; i < n; ++i) z[i] = @splat(b[i]);\n}\n"
    )


def _series() -> Iterator[str]:
    """log1p(y) = 2 artanh(w) with w = y / (2 + y), below 1 / 3."""
    yield "    @T s = q * (1.0 / 33.0) + 1.0 / 31.0;\n"
    for k in range(29, 0, -2):
        yield f"    s = s * q + {f'1.0 / {k}.0' if k > 1 else '1.0'};\n"


_PLUS = (
    """    const @T a = @abs(z), y = @exp(-a), b = 1.0 + y, c = 2.0 + y, one = 1.0 / (b * c);
    const @T r = one * c, low = y * r, w = y * (one * b), q = w * w;
"""
    + "".join(_series())
    + """    const @T plus = 0.5 * (z + a) + 2.0 * w * s, up = @NEGATIVE(z, low, r);
"""
)
_SIGMOID = """    const @T y = @exp(-@abs(z)), r = 1.0 / (1.0 + y), low = y * r;
    const @T up = @NEGATIVE(z, low, r), first = r * low;
"""
_TANH = """    const @T a = @abs(z), y = @exp(-2.0 * a), q = z * z;
    const @T far = (1.0 - y) / (1.0 + y);
    const @T top = 2027025.0 + q * (270270.0 + q * (6930.0 + q * 36.0));
    const @T bottom = 2027025.0 + q * (945945.0 + q * (51975.0 + q * (630.0 + q)));
    const @T signed_far = @NEGATIVE(z, -far, far);
    const @T t = @NEAR(a, z * top / bottom, signed_far), first = (1.0 - t) * (1.0 + t);
"""
_ACTIVATIONS = {
    "softplus": _PLUS + "    *h = plus, *d = up, *e = r * low;\n",
    "softplus_squared": _PLUS
    + "    *h = plus * plus, *d = 2.0 * plus * up, *e = 2.0 * (up * up + plus * (r * low));\n",
    "sigmoid": _SIGMOID + "    *h = up, *d = first, *e = first * @NEGATIVE(z, r - low, low - r);\n",
    "tanh": _TANH + "    *h = t, *d = first, *e = -2.0 * t * first;\n",
}
"""Value, first and second derivative of an activation at z."""


def _support(r: Network, kind: _Kind) -> list[str]:
    """Functions that all networks share, and the activation of this one."""
    assert isinstance(r.layout, NetworkLayout)
    name = r.layout.activation
    body = kind.written(_ACTIVATIONS[name])
    for word, bound in (("@NEGATIVE", "0.0"), ("@NEAR", "0.5")):
        while word in body:
            start = body.index(word)
            end = body.index(")", start)
            value, then, otherwise = body[start + len(word) + 1 : end].split(", ")
            limit = kind.splat + f"({bound})" if kind.splat else bound
            body = (
                body[:start] + kind.select.format(value, limit, then, otherwise) + body[end + 1 :]
            )
    head = f"static inline void softehl_{name}@S(@T z, @T *h, @T *d, @T *e)\n"
    return [kind.written(_dense()), kind.written(head) + f"{{\n{body}}}\n"]


@dataclass(frozen=True)
class _Layer:
    """Layer of a network in its array: places of weights, biases and weights of the inputs.

    first: place of its units among those of all hidden layers.
    """

    to: int
    start: int
    skip: bool
    W: int
    b: int
    V: int
    first: int


def _layers(layout: NetworkLayout) -> list[_Layer]:
    out, at, first = [], 0, 0
    for to, start, skip in layout.shapes:
        b = at + to * start
        out.append(_Layer(to, start, skip, at, b, b + to, first))
        at, first = b + to + skip * to * layout.inputs, first + to
    return out


def _network(d: Definition, r: Network, signature: str, kind: _Kind) -> str:
    assert isinstance(r.layout, NetworkLayout)
    write = _Rate if r.rate else _Value
    body = "".join(f"    {line}\n" for line in write(r, kind).lines())
    what = ("value", "slopes", "slopes and second derivatives")[r.order]
    along = " along the rate of the weights" if r.rate else ""
    zero = "0.0" if kind is _SINGLE else "softehl_splat(0.0)"
    unused = "" if kind is _SINGLE else "    (void)active, (void)lost;\n"
    end = "    return 0;\n" if kind is _SINGLE else ""
    opened = unused + _opened(d, r, "s", zero)
    return f"/* {r.name}: {what}{along} */\n{signature}{{\n{opened}{kind.written(body)}{end}}}\n"


class _Sweeps:
    """Statements of the sweeps through the layers of a network."""

    def __init__(self, r: Network, kind: _Kind) -> None:
        assert isinstance(r.layout, NetworkLayout)
        self.r, self.n, self.kind = r, r.layout.inputs, kind
        self.activation = f"softehl_{r.layout.activation}@S"
        *self.hidden, self.last = _layers(r.layout)
        self.units = sum(layer.to for layer in self.hidden)
        self.widest = max(layer.to for layer in self.hidden)

    def inputs(self, layer: _Layer, array: str = "h") -> str:
        """Arguments of a layer: the inputs, or hidden values."""
        return "p" if not layer.first else f"{array} + {layer.first - layer.start}"

    def units_of(self, layer: _Layer, statement: str) -> str:
        """A statement for each hidden unit u, with the number i in its layer."""
        return f"for (int i = 0, u = {layer.first}; i < {layer.to}; ++i, ++u) {statement}"

    def dense(self, layer: _Layer, weights: str, source: str, into: str) -> Iterator[str]:
        """into += W source."""
        at = f"{weights} + {layer.W}"
        yield f"softehl_dense@S({layer.to}, {layer.start}, {at}, {source}, {into});"

    def skip(self, layer: _Layer, weights: str, into: str) -> Iterator[str]:
        """into += V inputs, where a layer sees them."""
        if layer.skip:
            yield f"softehl_dense@S({layer.to}, {self.n}, {weights} + {layer.V}, p, {into});"

    def back(self, layer: _Layer, weights: str, z: str, into: str, inputs: str) -> Iterator[str]:
        """Derivatives by what a layer gets, from those by what it gives before its activation."""
        into = into if layer.first else inputs
        at = f"{weights} + {layer.W}"
        yield f"softehl_dense_back@S({layer.to}, {layer.start}, {at}, {z}, {into});"
        if layer.skip:
            at = f"{weights} + {layer.V}"
            yield f"softehl_dense_back@S({layer.to}, {self.n}, {at}, {z}, {inputs});"

    def forth(self) -> Iterator[str]:
        """Values h of all hidden units, and slopes d and e of their activations."""
        yield f"@T z[{self.widest}], h[{self.units}], d[{self.units}], e[{self.units}];"
        for layer in self.hidden:
            yield from self.affine(layer, "a", "z")
            unseen = layer is self.hidden[-1] and self.r.order > 0
            value = "unseen" if unseen else "h[u]"
            call = f"{self.activation}(z[i], &{value}, &d[u], &e[u]);"
            call = f"{{ @T unseen; {call} (void)unseen; }}" if unseen else call
            yield self.units_of(layer, call)
        yield "(void)h;"

    def affine(self, layer: _Layer, weights: str, into: str) -> Iterator[str]:
        """into = W h + b."""
        yield f"softehl_copy@S({layer.to}, {weights} + {layer.b}, {into});"
        yield from self.dense(layer, weights, self.inputs(layer), into)
        yield from self.skip(layer, weights, into)


class _Value(_Sweeps):
    """Value, slopes and second derivatives."""

    def lines(self) -> Iterator[str]:
        """All statements."""
        yield from self.forth()
        if self.r.order == 0:
            yield "(void)d, (void)e;"
            yield from self.affine(self.last, "a", "s")
            return
        yield from self._gradients()
        yield from self._second() if self.r.order == 2 else ["(void)e;"]

    def _gradients(self) -> Iterator[str]:
        """Slopes s by the inputs; e becomes what weighs J J^T."""
        n, last = self.n, self.last
        yield f"@T g[{self.widest}];"
        yield f"for (int k = 0; k < {n}; ++k) s[k] = @splat(0.0);"
        yield f"softehl_copy@S({last.start}, a + {last.W}, g);"
        if last.skip:
            yield f"softehl_copy@S({n}, a + {last.V}, s);"
        for layer in reversed(self.hidden):
            weigh = " e[u] *= g[i];" if self.r.order == 2 else ""
            yield self.units_of(layer, f"{{{weigh} z[i] = d[u] * g[i]; }}")
            if layer.first:
                yield f"for (int i = 0; i < {layer.start}; ++i) g[i] = @splat(0.0);"
            yield from self.back(layer, "a", "z", "g", "s")

    def _second(self) -> Iterator[str]:
        n, count = self.n, self.n * (self.n + 1) // 2
        yield f"@T *const H = s + {n}, J[{n}][{self.widest}], G[{n}][{self.widest}];"
        yield f"for (int k = 0; k < {count}; ++k) H[k] = @splat(0.0);"
        for layer in self.hidden:
            for k in range(n):
                seen = layer.V if layer.skip else layer.W
                if layer.first and not layer.skip:
                    yield f"for (int i = 0; i < {layer.to}; ++i) J[{k}][i] = @splat(0.0);"
                else:
                    entry = f"@splat(a[{seen} + {n} * i + {k}])"
                    yield f"for (int i = 0; i < {layer.to}; ++i) J[{k}][i] = {entry};"
                if layer.first:
                    yield from self.dense(layer, "a", f"G[{k}]", f"J[{k}]")
            yield self.units_of(layer, "{")
            yield f"    for (int k = 0, l = 0; k < {n}; ++k) {{"
            yield "        const @T t = e[u] * J[k][i];"
            yield f"        for (int j = k; j < {n}; ++j) H[l++] += t * J[j][i];"
            yield "        G[k][i] = d[u] * J[k][i];"
            yield "    }"
            yield "}"
        yield "(void)G;"


class _Rate(_Sweeps):
    """Rates of the value and of the slopes along the rate of the weights, r."""

    def lines(self) -> Iterator[str]:
        """All statements."""
        last, n = self.last, self.n
        yield from self.forth()
        yield f"@T f[{self.units}], y[{self.units}];"
        for layer in self.hidden:
            yield from self._moved(layer, "z")
            yield self.units_of(layer, "f[u] = z[i], y[u] = d[u] * z[i];")
        yield "(void)e, (void)f, (void)y;"
        if self.r.order == 0:
            yield from self._moved(last, "s")
            return
        yield f"@T g[{self.widest}], b[{self.widest}], c[{self.widest}], x[{n}];"
        yield f"for (int k = 0; k < {n}; ++k) s[k] = x[k] = @splat(0.0);"
        yield f"softehl_copy@S({last.start}, a + {last.W}, g);"
        yield f"softehl_copy@S({last.start}, r + {last.W}, b);"
        if last.skip:
            yield f"softehl_copy@S({n}, r + {last.V}, s);"
        for layer in reversed(self.hidden):
            moved = "c[i] = e[u] * f[u] * g[i] + d[u] * b[i];"
            yield self.units_of(layer, f"{{ z[i] = d[u] * g[i]; {moved} }}")
            if layer.first:
                zero = "g[i] = b[i] = @splat(0.0);"
                yield f"for (int i = 0; i < {layer.start}; ++i) {zero}"
            yield from self.back(layer, "a", "z", "g", "x")
            yield from self.back(layer, "a", "c", "b", "s")
            yield from self.back(layer, "r", "z", "b", "s")

    def _moved(self, layer: _Layer, into: str) -> Iterator[str]:
        """Rate of W h + b."""
        yield from self.affine(layer, "r", into)
        if layer.first:
            yield from self.dense(layer, "a", self.inputs(layer, "y"), into)

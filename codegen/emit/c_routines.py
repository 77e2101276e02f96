"""Printing the routines that a kernel calls, as static functions in front of it.

`int f(const double *in, double *out)` returns 0, or 1 when it has no result; the results are then
not-a-number and the kernel marks the whole element (`codegen.abi`).

C of (f(u) - f(v)) / (u - v) for the functions of the C library: where the values differ by more
than a quarter of their size the quotient loses two bits. Else u and v lie close, and an addition
theorem gives the difference without cancellation.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterable, Sequence

from softehl.codegen.emit import array_routines, tensor_routines, term_loops
from softehl.codegen.emit.c_printer import Printer, array_arguments, array_operands, number
from softehl.codegen.emit.code_motion import schedule
from softehl.codegen.graph.bessel import Bessel
from softehl.codegen.graph.divided_difference import Quotient, SecondQuotient
from softehl.codegen.graph.graph import Graph, Node, Op, Routine
from softehl.codegen.graph.routines import (
    HIGHEST_OF_STRETCHES,
    External,
    Inverse,
    Isotropic,
    NewtonRoutine,
    derivatives_of_energy,
)
from softehl.codegen.graph.run_time_arrays import ArrayRoutine
from softehl.codegen.graph.tensor_functions import MatrixKernel
from softehl.codegen.graph.term_reductions import Reduction
from softehl.codegen.graph.traversal import reachable
from softehl.codegen.language.definition import Definition
from softehl.codegen.optimise import passes
from softehl.function_address import LOWEST_ADDRESS

_CLOSE = {
    Op.LOG: """    const double z = d / v;
    s[0] = z == 0.0 ? 1.0 / v : log1p(z) / d;
""",
    Op.EXP: """    s[0] = d == 0.0 ? f : g * expm1(d) / d;
""",
    Op.SIN: """    const double h = 0.5 * d;
    s[0] = cos(v + h) * (h == 0.0 ? 1.0 : sin(h) / h);
""",
    Op.COS: """    const double h = 0.5 * d;
    s[0] = -sin(v + h) * (h == 0.0 ? 1.0 : sin(h) / h);
""",
    Op.TAN: """    s[0] = (d == 0.0 ? 1.0 : sin(d) / d) / (cos(u) * cos(v));
""",
    Op.ASIN: """    const double a = sqrt((1.0 - u) * (1.0 + u)), b = sqrt((1.0 - v) * (1.0 + v));
    const double w = b + v * (u + v) / (a + b), t = d * w;
    s[0] = t == 0.0 ? w : asin(t) / d;
""",
    Op.ATAN: """    const double w = 1.0 / (1.0 + u * v), t = d * w;
    s[0] = t == 0.0 ? w : atan(t) / d;
""",
    Op.SINH: """    const double h = 0.5 * d;
    s[0] = cosh(v + h) * (h == 0.0 ? 1.0 : sinh(h) / h);
""",
    Op.COSH: """    const double h = 0.5 * d;
    s[0] = sinh(v + h) * (h == 0.0 ? 1.0 : sinh(h) / h);
""",
    Op.TANH: """    const double a = fmax(fabs(u), fabs(v)), b = fmin(fabs(u), fabs(v));
    const double k = 2.0 * (b - a), e = exp(-2.0 * b);
    s[0] = 4.0 * e * (k == 0.0 ? 1.0 : expm1(k) / k) / ((1.0 + e) * (1.0 + exp(-2.0 * a)));
""",
    Op.ASINH: """    const double both = u * sqrt(1.0 + v * v) + v * sqrt(1.0 + u * u);
    const double w = both == 0.0 ? 1.0 : (u + v) / both, t = d * w;
    s[0] = t == 0.0 ? w : asinh(t) / d;
""",
    Op.ACOSH: """    const double a = sqrt((u - 1.0) * (u + 1.0)), b = sqrt((v - 1.0) * (v + 1.0));
    const double w = (u + v) / (u * b + v * a), t = d * w;
    s[0] = t == 0.0 ? w : asinh(t) / d;
""",
    Op.ATANH: """    const double w = 2.0 / ((1.0 - u) * (1.0 + v) + (1.0 + u) * (1.0 - v));
    const double t = d * w;
    s[0] = t == 0.0 ? w : atanh(t) / d;
""",
    Op.ERF: """    s[0] = softehl_mean_bell(u, v);
""",
    Op.POWER: """    const double z = d / v;
    if (d == 0.0)
        s[0] = p[4] * pow(v, p[4] - 1.0);
    else
        s[0] = u / v > 0.0 ? g * expm1(p[4] * log1p(z)) / d : (f - g) / d;
""",
}
_CLOSE[Op.ACOS] = _CLOSE[Op.ASIN].replace("w : asin(t) / d", "-w : -asin(t) / d")
_CLOSE[Op.ERFC] = _CLOSE[Op.ERF].replace("softehl", "-softehl")

_ANGLE = """/* The turn from (w, v) to (x, y) has the sine y w - x v and the cosine x w + y v,
   except across the cut of atan2. */
{signature}{{
{unused}    const double y = p[0], x = p[1], v = p[2], w = p[3], f = p[4], g = p[5];
    const double sine = y * w - x * v, cosine = x * w + y * v, turn = atan2(sine, cosine);
    if (sine == 0.0 && cosine > 0.0)
        s[0] = p[6] / cosine;
    else
        s[0] = fabs(turn - (f - g)) < 1.0 && sine != 0.0 ? p[6] * (turn / sine) : (f - g) / p[7];
    return 0;
}}
"""

_BELL = """/* Mean of 2 / sqrt(pi) exp(-x^2) between u and v: far from zero a quotient of erfc,
   where this loses more than two bits by Gauss's rule of six points, exact to rounding. */
static double softehl_mean_bell(double u, double v)
{
    const double a = fabs(u), b = fabs(v), f = erfc(a), g = erfc(b);
    if (u * v > 0.0 && fabs(f - g) > 0.25 * (f + g)) return (g - f) / (a - b);
    static const double at[3] = {
        0.23861918608319691, 0.66120938646626451, 0.93246951420315203};
    static const double weight[3] = {
        0.46791393457269105, 0.36076157304813861, 0.17132449237917035};
    const double h = 0.5 * (u - v), middle = v + h;
    double mean = 0.0;
    for (int k = 0; k < 3; ++k) {
        const double x = middle + at[k] * h, y = middle - at[k] * h;
        mean += weight[k] * (exp(-x * x) + exp(-y * y));
    }
    return 0.56418958354775629 * mean;
}
"""


_LENGTH = """/* Length of a vector and its rounding, so that the sine of a large one is right. */
static double softehl_length(int n, const double *w, double *rest)
{
    double high = 0.0, low = 0.0;
    *rest = 0.0;
    if (n == 1) return fabs(w[0]);
    for (int k = 0; k < n; ++k) {
        const volatile double square = w[k] * w[k];  /* else it is joined with the sum */
        const double t = square, total = high + t, part = total - high;
        low += (high - (total - part)) + (t - part) + fma(w[k], w[k], -t);
        high = total;
    }
    const double x = sqrt(high);
    if (x > 0.0) *rest = (fma(-x, x, high) + low) / (2.0 * x);
    return x;
}
"""

_BESSEL = """/* j_n(x) / x^n by its series, from x^2 = 10 on by recurrence from sine and cosine. */
static double softehl_bessel(int n, double x, double rest)
{
    const double q = x * (x + 2.0 * rest);
    if (n == 0 && q == 0.0) return 1.0;
    const double sine = sin(x) + rest * cos(x);
    if (n == 0) return sine / (x + rest);
    if (q < 10.0) {
        double term = 1.0;
        for (int k = 1; k <= n; ++k) term /= 2 * k + 1;
        double sum = term;
        for (int k = 1; k < 40 && fabs(term) > 1e-18 * fabs(sum); ++k)
            sum += term *= -0.5 * q / (k * (2.0 * (n + k) + 1.0));
        return sum;
    }
    double before = cos(x) - rest * sin(x), now = sine / (x + rest);
    for (int k = 0; k < n; ++k) {
        const double next = ((2 * k + 1) * now - before) / q;
        before = now, now = next;
    }
    return now;
}
"""


def quotient(op: Op, signature: str, unused: str = "") -> list[str]:
    """C function of a `Quotient` and its callees, callees first; unused: its first statement."""
    if op is Op.ATAN2:
        return [_ANGLE.format(signature=signature, unused=unused)]
    text = f"""/* ({op}(u) - {op}(v)) / (u - v) */
{signature}{{
{unused}\
    const double u = p[0], v = p[1], f = p[2], g = p[3], d = u - v;
    (void)f, (void)g;
    if (fabs(f - g) > 0.25 * (fabs(f) + fabs(g))) {{
        s[0] = (f - g) / d;
        return 0;
    }}
{_CLOSE[op]}    return 0;
}}
"""
    return [*([_BELL] if op in (Op.ERF, Op.ERFC) else []), text]


def called(roots: Iterable[Node]) -> list[Routine]:
    """Routines below `roots`, in the order of their calls."""
    calls = [n.payload for n in reachable(roots) if n.op is Op.CALL]
    return list(dict.fromkeys(r for r in calls if isinstance(r, Routine)))


def texts(
    d: Definition,
    routines: Iterable[Routine],
    text: Callable[[Definition, Routine], list[str]] | None = None,
) -> list[str]:
    """C functions of `routines` and their callees, each once, callees first.

    text: what prints one of them, if it is another printer than this one.
    """
    return list(dict.fromkeys(c for r in routines for c in (text or _text)(d, r)))


def _text(d: Definition, r: Routine) -> list[str]:
    match r:
        case NewtonRoutine():
            return _newton(d, r)
        case Inverse():
            return [_ELIMINATE, _inverse(d, r)]
        case Isotropic():
            twice = [_TWICE] if r.order == HIGHEST_OF_STRETCHES else []
            return [_JACOBI, *twice, *_isotropic(d, r)]
        case Quotient():
            return quotient(r.op, _signature(d, r), arrays_unused(d))
        case Reduction():
            values, targets = term_loops.bodies(r)
            body = Body(d, d.graph, values, Printer(d))
            loop = term_loops.single(d, r, _signature(d, r), body.text(2, targets))
            return [*texts(d, body.called), loop]
        case ArrayRoutine():
            return array_routines.single(d, r, _signature(d, r))
        case External():
            return _external(d, r)
        case SecondQuotient():
            return [tensor_routines.second_quotient(r, _signature(d, r), arrays_unused(d))]
        case Bessel():
            return _bessel(r, _signature(d, r), arrays_unused(d))
        case MatrixKernel():
            return tensor_routines.text(r, _signature(d, r), arrays_unused(d))
    raise TypeError(f"no C for {r}")


def _signature(d: Definition, r: Routine) -> str:
    name = f"softehl_{d.name}_{r.name}"
    if d.arrays:
        arguments = f"{array_arguments(d)}const double *restrict p, double *restrict s"
        return f"static int {name}(\n    {arguments})\n"
    return f"static int {name}(const double *restrict p, double *restrict s)\n"


def arrays_unused(d: Definition) -> str:
    """Statement for a routine that may read no array of a model with some."""
    return "".join(f"    (void){name};\n" for name in array_operands(d).split(", ")[:-1])


class Body:
    """Statements that compute localised values in a routine; `called` are the routines in it."""

    def __init__(self, d: Definition, g: Graph, roots: Sequence[Node], printer: Printer) -> None:
        self.roots, _ = passes.run(g, list(roots), passes.STANDARD)
        self.printer, self.called = printer, called(self.roots)

    def text(self, depth: int, targets: Sequence[str]) -> str:
        """The values and their stores."""
        p = self.printer
        plan = schedule(self.roots)
        p.read(plan, self.roots)
        for group in plan.stages:
            p.block(depth, group.preamble)
        for target, n in zip(targets, self.roots, strict=True):
            p.line(depth, f"{target} = {p.value(n)};")
        return p.text()


def newton_values(r: NewtonRoutine) -> tuple[list[Node], list[str]]:
    """Values of every step of a local iteration, and the variables that take them."""
    n, first = r.outputs, r.inputs - r.outputs
    derivatives = [a for rows in (r.by_local, r.by_external) for row in rows for a in row]
    targets = [*(f"g[{i}]" for i in range(n)), *(f"A[{i}]" for i in range(n * n))]
    return [*r.equations, *derivatives], targets + [f"B[{i}]" for i in range(n * first)]


def rounding(r: NewtonRoutine) -> str:
    """Bound of the rounding of an equation, relative to the sum of its terms."""
    return number(r.inputs * sys.float_info.epsilon)


def _newton(d: Definition, r: NewtonRoutine) -> list[str]:
    n, first = r.outputs, r.inputs - r.outputs
    values, targets = newton_values(r)
    body = Body(d, d.graph, values, Printer(d))
    control, size = r.control, number(float(r.control.size))
    text = f"""/* {r.name}: {n} local unknowns, at most {control.iterations} Newton steps */
{_signature(d, r)}{{
{arrays_unused(d)}    int failed = 0;
    const double tolerance = {number(float(control.tolerance))};
    double before[{n}];
    for (int k = 0; k < {n}; ++k) s[k] = p[{first} + k], before[k] = HUGE_VAL;
    for (int step = 0; step < {control.iterations}; ++step) {{
        double g[{n}], A[{n * n}], B[{max(n * first, 1)}];
{body.text(2, targets)}
        int far = 0;
        double felt[{n}] = {{0.0}};
        for (int i = 0; i < {n}; ++i) {{
            const double terms = softehl_terms({n}, A + {n} * i, s, {first}, B + {first} * i, p);
            far |= !(fabs(g[i]) <= tolerance * terms);
            for (int k = 0; k < {n}; ++k) felt[k] = fmax(felt[k], fabs(A[{n} * i + k]) / terms);
        }}
        if (failed || softehl_eliminate({n}, A, 1, g)) break;
        for (int k = 0; k < {n}; ++k) {{
            s[k] -= g[k];
            const double change = fabs(g[k]), close = tolerance * ({size} + fabs(s[k]));
            const int rounding = change > 0.9 * before[k] || felt[k] * change <= {rounding(r)};
            far |= !(change <= close || rounding);
            before[k] = change;
        }}
        if (!far) return 0;
    }}
    for (int k = 0; k < {n}; ++k) s[k] = NAN;
    return 1;
}}
"""
    return [_TERMS, _ELIMINATE, *texts(d, body.called), text]


def _inverse(d: Definition, r: Inverse) -> str:
    n = r.size
    return f"""{_signature(d, r)}{{
{arrays_unused(d)}    double A[{n * n}];
    for (int k = 0; k < {n * n}; ++k) A[k] = p[k], s[k] = k % {n + 1} == 0;
    if (!softehl_eliminate({n}, A, {n}, s)) return 0;
    for (int k = 0; k < {n * n}; ++k) s[k] = NAN;
    return 1;
}}
"""


def _external(d: Definition, r: External) -> list[str]:
    f = r.function
    texts, name = [f.declaration], f.symbol
    if not f.text:
        name = f"softehl_{d.name}_at_{f.name}"
        texts = [
            f"""#include <stdint.h>
static int {name}(int order, const double *restrict p, double *restrict s)
{{
    typedef int function(const double *, double *, double *, double *);
    if (!(p[0] >= {LOWEST_ADDRESS}.0)) return 1;
    function *at = (function *)(uintptr_t)p[0];
    const double *x = p + 1;
{f.body("at").removeprefix("{").lstrip(chr(10))}"""
        ]
    return [
        *texts,
        f"""/* {r.name}: {f.name} of the user, derivatives up to order {r.order} */
{_signature(d, r)}{{
{arrays_unused(d)}    if (!{name}({r.order}, p, s)) return 0;
    for (int k = 0; k < {r.outputs}; ++k) s[k] = NAN;
    return 1;
}}
""",
    ]


def _isotropic(d: Definition, r: Isotropic) -> list[str]:
    body = Body(d, d.graph, derivatives_of_energy(d.graph, r), Printer(d))
    name = f"softehl_{d.name}_{r.name}_of_eigenvalues"
    arrays, head = array_operands(d), array_arguments(d)
    local = f"""/* {r.name}: {_CONTENT[r.order]} by the eigenvalues */
static int {name}(
    {head}const double *restrict s, const double *restrict p, double *restrict w)
{{
{arrays_unused(d)}    int failed = 0;
    (void)s, (void)p;
{body.text(1, [f"w[{k}]" for k in range(len(body.roots))])}
    return failed;
}}
"""
    size, values = (3, "c") if r.order < HIGHEST_OF_STRETCHES else (6, "softehl_twice(c)")
    text = f"""{_signature(d, r)}{{
    double c[{size}], Q[9], w[{len(body.roots)}];
    if (softehl_eigenvalues(p, c, Q) || {name}({arrays}{values}, p + 6, w)) {{
        for (int k = 0; k < {r.outputs}; ++k) s[k] = NAN;
        return 1;
    }}
{_ASSEMBLE[r.order]}    return 0;
}}
"""
    return [*texts(d, body.called), local, text]


_CONTENT = (
    *("energy", "first derivatives", "first and second derivatives"),
    "third derivatives, those of divided differences, and the second of these",
)

_TERMS = """/* What cancels in an equation: the sum of |slope * value| over the local unknowns
   and all that comes from outside. */
static double softehl_terms(
    int n, const double *A, const double *s, int m, const double *B, const double *p)
{
    double terms = 0.0;
    for (int k = 0; k < n; ++k) terms += fabs(A[k] * s[k]);
    for (int k = 0; k < m; ++k) {
        const double term = fabs(B[k] * p[k]);
        if (term < HUGE_VAL) terms += term;
    }
    return terms;
}
"""

_ELIMINATE = """/* Solve A x = b for `count` columns b in place, with partial pivoting. */
static int softehl_eliminate(int n, double *A, int count, double *b)
{
    for (int k = 0; k < n; ++k) {
        int best = k;
        for (int i = k + 1; i < n; ++i)
            if (fabs(A[i * n + k]) > fabs(A[best * n + k])) best = i;
        const double pivot = A[best * n + k];
        if (!(fabs(pivot) > 0.0)) return 1;
        for (int j = 0; j < n; ++j) {
            const double swapped = A[best * n + j];
            A[best * n + j] = A[k * n + j], A[k * n + j] = swapped;
        }
        for (int j = 0; j < count; ++j) {
            const double swapped = b[best * count + j];
            b[best * count + j] = b[k * count + j], b[k * count + j] = swapped;
        }
        for (int i = k + 1; i < n; ++i) {
            const double factor = A[i * n + k] / pivot;
            for (int j = k; j < n; ++j) A[i * n + j] -= factor * A[k * n + j];
            for (int j = 0; j < count; ++j) b[i * count + j] -= factor * b[k * count + j];
        }
    }
    for (int k = n - 1; k >= 0; --k)
        for (int j = 0; j < count; ++j) {
            for (int i = k + 1; i < n; ++i) b[k * count + j] -= A[k * n + i] * b[i * count + j];
            b[k * count + j] /= A[k * n + k];
        }
    return 0;
}
"""

_JACOBI = """/* Eigenvalues c and vectors (columns of Q) of C_11, C_22, C_33, C_12, C_13, C_23
   by Jacobi's rotations.  Returns 1 unless C is positive definite. */
static int softehl_eigenvalues(const double *restrict C, double *restrict c, double *restrict Q)
{
    double A[3][3] = {{C[0], C[3], C[4]}, {C[3], C[1], C[5]}, {C[4], C[5], C[2]}};
    for (int k = 0; k < 9; ++k) Q[k] = k % 4 == 0;
    for (int sweep = 0; sweep < 12; ++sweep)
        for (int i = 0; i < 2; ++i)
            for (int j = i + 1; j < 3; ++j) {
                if (!(fabs(A[i][j]) > 1e-30 * (fabs(A[i][i]) + fabs(A[j][j])))) {
                    A[i][j] = A[j][i] = 0.0;
                    continue;
                }
                const double half = (A[j][j] - A[i][i]) / (2.0 * A[i][j]);
                const double t = (half < 0.0 ? -1.0 : 1.0) / (fabs(half) + sqrt(half * half + 1.0));
                const double cosine = 1.0 / sqrt(t * t + 1.0), sine = t * cosine;
                const int k = 3 - i - j;
                const double a = A[i][k], b = A[j][k];
                A[i][i] -= t * A[i][j], A[j][j] += t * A[i][j];
                A[i][j] = A[j][i] = 0.0;
                A[i][k] = A[k][i] = cosine * a - sine * b;
                A[j][k] = A[k][j] = sine * a + cosine * b;
                for (int r = 0; r < 3; ++r) {
                    const double x = Q[3 * r + i], y = Q[3 * r + j];
                    Q[3 * r + i] = cosine * x - sine * y, Q[3 * r + j] = sine * x + cosine * y;
                }
            }
    for (int k = 0; k < 3; ++k) c[k] = A[k][k];
    return !(c[0] > 0.0 && c[1] > 0.0 && c[2] > 0.0);
}
"""

_TWICE = """/* Eigenvalues, and each of them once more. */
static const double *softehl_twice(double *restrict c)
{
    for (int k = 0; k < 3; ++k) c[3 + k] = c[k];
    return c;
}
"""

_ENTRIES = """    static const int row[6] = {0, 1, 2, 0, 0, 1}, column[6] = {0, 1, 2, 1, 2, 2};
"""
_IN_BASIS = f"""{_ENTRIES}    double E[6][6];
    for (int k = 0, a = 0; a < 3; ++a)
        for (int b = a; b < 3; ++b) {{
            const int n = a == b ? a : 3 + k++;
            for (int i = 0; i < 6; ++i) {{
                const double *x = Q + 3 * row[i], *y = Q + 3 * column[i];
                E[n][i] = (i > 2 ? 1.0 : 0.5) * (x[a] * y[b] + x[b] * y[a]);
            }}
        }}
"""
_ASSEMBLE = (
    """    s[0] = w[0];
""",
    f"""{_ENTRIES}    for (int i = 0; i < 6; ++i) {{
        s[i] = 0.0;
        for (int a = 0; a < 3; ++a) s[i] += w[a] * Q[3 * row[i] + a] * Q[3 * column[i] + a];
        if (i > 2) s[i] *= 2.0;
    }}
""",
    f"""{_ENTRIES}    static const int at[3][3] = {{{{3, 4, 5}}, {{4, 6, 7}}, {{5, 7, 8}}}};
    double E[6][6], H[6][6];
    for (int k = 0, a = 0; a < 3; ++a)
        for (int b = a; b < 3; ++b) {{
            const int n = a == b ? a : 3 + k++;
            for (int i = 0; i < 6; ++i) {{
                const double *x = Q + 3 * row[i], *y = Q + 3 * column[i];
                E[n][i] = (i > 2 ? 1.0 : 0.5) * (x[a] * y[b] + x[b] * y[a]);
            }}
        }}
    for (int i = 0; i < 6; ++i)
        for (int a = 0; a < 3; ++a) {{
            H[a][i] = 0.0;
            for (int b = 0; b < 3; ++b) H[a][i] += w[at[a][b]] * E[b][i];
            H[3 + a][i] = 2.0 * w[9 + a] * E[3 + a][i];
        }}
    for (int n = 0, i = 0; i < 6; ++i)
        for (int j = i; j < 6; ++j, ++n) {{
            s[n] = 0.0;
            for (int k = 0; k < 6; ++k) s[n] += E[k][i] * H[k][j];
        }}
""",
    f"""{_IN_BASIS}    static const int at[3][3][3] = {{
        {{{{0, 1, 2}}, {{1, 3, 4}}, {{2, 4, 5}}}},
        {{{{1, 3, 4}}, {{3, 6, 7}}, {{4, 7, 8}}}},
        {{{{2, 4, 5}}, {{4, 7, 8}}, {{5, 8, 9}}}}}};
    for (int n = 0, i = 0; i < 6; ++i)
        for (int j = i; j < 6; ++j)
            for (int k = j; k < 6; ++k, ++n) {{
                s[n] = 0.0;
                for (int a = 0; a < 3; ++a)
                    for (int b = 0; b < 3; ++b)
                        for (int e = 0; e < 3; ++e)
                            s[n] += w[at[a][b][e]] * E[a][i] * E[b][j] * E[e][k];
                for (int m = 0; m < 3; ++m)
                    for (int e = 0; e < 3; ++e) {{
                        const double *x = E[3 + m], *y = E[e];
                        const double t = y[i] * x[j] * x[k] + y[j] * x[i] * x[k];
                        s[n] += 2.0 * w[10 + 3 * m + e] * (t + y[k] * x[i] * x[j]);
                    }}
                for (int m = 0; m < 3; ++m) {{
                    const double *x = E[3 + m], *y = E[3 + (m + 1) % 3], *z = E[3 + (m + 2) % 3];
                    s[n] += 2.0 * w[19] * x[i] * (y[j] * z[k] + z[j] * y[k]);
                }}
            }}
""",
)


def _bessel(r: Bessel, signature: str, unused: str) -> list[str]:
    """The C function of a routine and its callees, callees first."""
    return [
        _LENGTH,
        _BESSEL,
        f"""/* S_{r.order} of a length */
{signature}{{
{unused}    double rest;
    const double x = softehl_length({r.inputs}, p, &rest);
    s[0] = x < HUGE_VAL ? softehl_bessel({r.order}, x, rest) : NAN;
    return !(x < HUGE_VAL);
}}
""",
    ]

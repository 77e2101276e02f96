"""C of the routines of tensor functions: eigenvalues, sums over them, the matrix exponential.

Symmetric matrices have the entries C_11, C_22, C_33, C_12, C_13, C_23 (C_11, C_22, C_12); pairs of
eigenvalues stand in the same order. V_mi is n_a n_b of pair m in entry i, both orders added.
"""

from __future__ import annotations

from dataclasses import dataclass

from softehl.codegen.graph.divided_difference import SecondQuotient
from softehl.codegen.graph.graph import Op
from softehl.codegen.graph.tensor_functions import KernelKind, MatrixKernel, entry_pairs


@dataclass(frozen=True)
class Numbers:
    """Words of C for one element, or for a vector of lanes."""

    kind: str
    zero: str
    end: str
    finite: str
    """Statement that fails where `p[k]` is not finite."""


SCALAR = Numbers("double", "0.0", "return lost;", "lost |= !(fabs(p[k]) < HUGE_VAL);")
LANES = Numbers(
    "V",
    "softehl_splat(0.0)",
    "*lost |= active & spoilt;",
    "spoilt |= ~softehl_lt(softehl_vfabs(p[k]), softehl_splat(HUGE_VAL));",
)


def in_lanes(r: MatrixKernel) -> bool:
    """True for routines that are printed for vectors of lanes as well."""
    return r.kind in (KernelKind.SUM, KernelKind.SLOPE, KernelKind.CURVATURE, KernelKind.BENDING)


def text(r: MatrixKernel, signature: str, unused: str, numbers: Numbers = SCALAR) -> list[str]:
    """The C function of a routine and its callees, callees first."""
    match r.kind:
        case KernelKind.EIGEN:
            return [_FORM, _JACOBI, _eigen(r, signature, unused)]
        case KernelKind.EXP | KernelKind.EXP_SLOPE | KernelKind.EXP_CURVATURE:
            return [_PRODUCT, _MOVE, _SCALING, _exponential(r, signature, unused)]
    n, entries = r.size, r.size * (r.size + 1) // 2
    pairs = entry_pairs(n)
    rows, columns = (", ".join(str(p[k]) for p in pairs) for k in (0, 1))
    failed = "int lost = 0;" if numbers is SCALAR else "M spoilt = softehl_mask(0);"
    body = _BODIES[r.kind]
    if r.kind is KernelKind.CURVATURE and n == 3:
        body = body.replace("{triple}", _TRIPLE)
    values_of = {
        "{triple}": "",
        "{n}": str(n),
        "{N}": str(entries),
        "{T}": numbers.kind,
        "{zero}": numbers.zero,
        "{first}": str(
            {KernelKind.SLOPE: entries, KernelKind.SUM: n}.get(r.kind, n * n if n == 2 else 10)
        ),
        "{gap}": _GAP[numbers is SCALAR],
    }
    for mark, value in values_of.items():
        body = body.replace(mark, value)
    checked = r.inputs if r.kind is KernelKind.BENDING else r.inputs - n * n
    if r.kind is KernelKind.CURVATURE:
        checked = r.inputs - n * n - entries
    products = "" if r.kind is KernelKind.SUM else _PRODUCTS
    for mark, value in values_of.items():
        products = products.replace(mark, value)
    return [
        f"""{signature}{{
{unused}    static const int row[{entries}] = {{{rows}}}, column[{entries}] = {{{columns}}};
    {failed}
    for (int k = 0; k < {checked}; ++k) {numbers.finite}
{body.replace("{products}", products)}    {numbers.end}
}}
"""
    ]


_PRODUCTS = """    {T} v[{N}][{N}];
    for (int m = 0; m < {N}; ++m)
        for (int i = 0; i < {N}; ++i) {
            const {T} *x = Q + {n} * row[i], *y = Q + {n} * column[i];
            v[m][i] = x[row[m]] * y[column[m]];
            if (m >= {n}) v[m][i] += x[column[m]] * y[row[m]];
        }
"""

_BODIES = {
    KernelKind.SUM: """    const {T} *Q = p + {first};
    for (int i = 0; i < {N}; ++i) {
        s[i] = {zero};
        for (int a = 0; a < {n}; ++a)
            s[i] += p[a] * Q[{n} * row[i] + a] * Q[{n} * column[i] + a];
    }
""",
    KernelKind.SLOPE: """    const {T} *Q = p + {first};
{products}    {T} h[{N}];
    for (int n = 0, i = 0; i < {N}; ++i) {
        for (int m = 0; m < {N}; ++m) h[m] = (m < {n} ? 1.0 : 0.5) * p[m] * v[m][i];
        for (int j = i; j < {N}; ++j, ++n) {
            s[n] = {zero};
            for (int m = 0; m < {N}; ++m) s[n] += h[m] * v[m][j];
        }
    }
""",
    KernelKind.CURVATURE: """    const {T} *Q = p + {first}, *along = Q + {n} * {n};
{products}    {T} P[{N}], K[{N}][{N}], h[{N}];
    for (int m = 0; m < {N}; ++m) {
        P[m] = {zero};
        for (int i = 0; i < {N}; ++i) {
            P[m] += (m < {n} ? 1.0 : 0.5) * along[i] * v[m][i];
            K[m][i] = {zero};
        }
    }
    for (int a = 0; a < {n}; ++a) K[a][a] = 2.0 * p[a] * P[a];
    for (int m = {n}; m < {N}; ++m) {
        const int a = row[m], b = column[m];
        const {T} aab = p[{n} + 2 * (m - {n})], abb = p[{n} + 2 * (m - {n}) + 1];
        K[a][m] = K[m][a] = aab * P[m], K[b][m] = K[m][b] = abb * P[m];
        K[m][m] = 0.5 * (aab * P[a] + abb * P[b]);
    }
{triple}    for (int n = 0, i = 0; i < {N}; ++i) {
        for (int m = 0; m < {N}; ++m) {
            h[m] = {zero};
            for (int k = 0; k < {N}; ++k) h[m] += K[m][k] * v[k][i];
        }
        for (int j = i; j < {N}; ++j, ++n) {
            {T} total = {zero};
            for (int m = 0; m < {N}; ++m) total += h[m] * v[m][j];
            s[n] = ((i < {n} ? 1.0 : 2.0) * (j < {n} ? 1.0 : 2.0)) * total;
        }
    }
""",
    KernelKind.BENDING: """    const {T} *Q = p + {n}, *along = Q + {n} * {n};
{products}    {T} h[{N}];
    for (int m = {n}; m < {N}; ++m) {
        const {T} x = p[row[m]], y = p[column[m]];
        const {T} top = 0.5 * (along[row[m]] - along[column[m]]);
        h[m] = {gap};
    }
    for (int n = 0, i = 0; i < {N}; ++i)
        for (int j = i; j < {N}; ++j, ++n) {
            s[n] = {zero};
            for (int m = {n}; m < {N}; ++m) s[n] += h[m] * v[m][i] * v[m][j];
            s[n] *= (i < {n} ? 1.0 : 2.0) * (j < {n} ? 1.0 : 2.0);
        }
""",
}
_TRIPLE = """    for (int k = 3; k < 6; ++k)
        for (int l = 3; l < 6; ++l)
            if (k != l) K[k][l] = 0.5 * p[9] * P[12 - k - l];
"""
_GAP = {
    True: "fabs(x - y) > 0x1p-48 * (fabs(x) + fabs(y)) ? top / (x - y) : 0.0",
    False: """softehl_blend(
            softehl_lt(0x1p-48 * (softehl_vfabs(x) + softehl_vfabs(y)), softehl_vfabs(x - y)),
            top / (x - y), softehl_splat(0.0))""",
}


_ABOUT_EIGENVALUES = """/* Eigenvalues, the largest first, and vectors (columns) of a symmetric
   matrix.  Small ones next to large ones are computed again, from the matrix in their basis and in
   twice the digits. */
"""


def _eigen(r: MatrixKernel, signature: str, unused: str) -> str:
    n = r.size
    pairs = entry_pairs(n)
    filled = ", ".join(
        "{"
        + ", ".join(
            f"p[{pairs.index((min(i, j), max(i, j)))}]" if j < n else "0.0" for j in range(3)
        )
        + "}"
        for i in range(n)
    )
    filled += ", {0.0, 0.0, 0.0}" * (3 - n)
    return f"""{_ABOUT_EIGENVALUES}{signature}{{
{unused}    double A[3][3] = {{{filled}}};
    double C[3][3], Q[{n * n}], B[3][3];
    for (int k = 0; k < 9; ++k) C[k / 3][k % 3] = A[k / 3][k % 3];
    for (int k = 0; k < {n * n}; ++k) Q[k] = k % {n + 1} == 0;
    int lost = 0;
    for (int k = 0; k < {len(pairs)}; ++k) lost |= !(fabs(p[k]) < HUGE_VAL);
    if (lost) {{
        for (int k = 0; k < {r.outputs}; ++k) s[k] = NAN;
        return 1;
    }}
    softehl_rotate({n}, A, Q);
    double most = 0.0, least = HUGE_VAL;
    for (int a = 0; a < {n}; ++a)
        most = fmax(most, fabs(A[a][a])), least = fmin(least, fabs(A[a][a]));
    if (least < 0.02 * most) {{
        for (int a = 0; a < {n}; ++a)
            for (int b = a; b < {n}; ++b) B[a][b] = B[b][a] = softehl_form({n}, C, Q, a, b);
        softehl_rotate({n}, B, Q);
        for (int a = 0; a < {n}; ++a) A[a][a] = B[a][a];
    }}
    int order[3] = {{0, 1, 2}};
    for (int i = 1; i < {n}; ++i)
        for (int j = i; j > 0 && A[order[j]][order[j]] > A[order[j - 1]][order[j - 1]]; --j) {{
            const int other = order[j];
            order[j] = order[j - 1], order[j - 1] = other;
        }}
    for (int a = 0; a < {n}; ++a) {{
        s[a] = A[order[a]][order[a]];
        for (int i = 0; i < {n}; ++i) s[{n} + {n} * i + a] = Q[{n} * i + order[a]];
    }}
    return 0;
}}
"""


_FORM = """/* Sum of Q_ia C_ij Q_jb in twice the digits. */
static double softehl_form(int n, double C[3][3], const double *Q, int a, int b)
{
    double high = 0.0, low = 0.0;
    for (int i = 0; i < n; ++i)
        for (int j = 0; j < n; ++j) {
            const double x = Q[n * i + a], y = Q[n * j + b];
            const volatile double once = x * C[i][j];  /* else it is joined with a sum */
            const double c = once, rest = fma(x, C[i][j], -c);
            const volatile double twice = c * y;
            const double t = twice, total = high + t, part = total - high;
            low += (high - (total - part)) + (t - part) + fma(c, y, -t) + rest * y;
            high = total;
        }
    return high + low;
}
"""

_JACOBI = """/* Jacobi's rotations: A becomes diagonal, Q is turned along. */
static void softehl_rotate(int n, double A[3][3], double *Q)
{
    for (int sweep = 0; sweep < 12; ++sweep) {
        int turned = 0;
        for (int i = 0; i < n - 1; ++i)
            for (int j = i + 1; j < n; ++j) {
                if (!(fabs(A[i][j]) > 1e-30 * (fabs(A[i][i]) + fabs(A[j][j])))) {
                    A[i][j] = A[j][i] = 0.0;
                    continue;
                }
                turned = 1;
                const double half = (A[j][j] - A[i][i]) / (2.0 * A[i][j]);
                const double t = (half < 0.0 ? -1.0 : 1.0) / (fabs(half) + sqrt(half * half + 1.0));
                const double cosine = 1.0 / sqrt(t * t + 1.0), sine = t * cosine;
                A[i][i] -= t * A[i][j], A[j][j] += t * A[i][j];
                A[i][j] = A[j][i] = 0.0;
                if (n == 3) {
                    const int k = 3 - i - j;
                    const double a = A[i][k], b = A[j][k];
                    A[i][k] = A[k][i] = cosine * a - sine * b;
                    A[j][k] = A[k][j] = sine * a + cosine * b;
                }
                for (int r = 0; r < n; ++r) {
                    const double x = Q[n * r + i], y = Q[n * r + j];
                    Q[n * r + i] = cosine * x - sine * y, Q[n * r + j] = sine * x + cosine * y;
                }
            }
        if (!turned) break;
    }
}
"""

# ---------------------------------------------------------------------------- matrix exponential

_PRODUCT = """/* C += factor A B */
static void softehl_multiply(
    int n, double factor, const double *A, const double *B, double *restrict C)
{
    for (int i = 0; i < n; ++i)
        for (int k = 0; k < n; ++k) {
            const double a = factor * A[n * i + k];
            for (int j = 0; j < n; ++j) C[n * i + j] += a * B[n * k + j];
        }
}
"""

_MOVE = """static void softehl_move(int n, const double *from, double *to)
{
    for (int k = 0; k < n; ++k) to[k] = from[k];
}
"""

_SCALING = """/* Halvings after which a norm is at most 1, and terms of the exponential series and
   of its second derivative that are above rounding then. */
static int softehl_scaling(int n, const double *A, int *terms)
{
    double norm = 0.0;
    for (int i = 0; i < n; ++i) {
        double sum = 0.0;
        for (int j = 0; j < n; ++j) sum += fabs(A[n * i + j]);
        norm = fmax(norm, sum);
    }
    int halvings = 0;
    if (norm > 1.0) (void)frexp(norm, &halvings);
    double term = 1.0;
    norm = ldexp(norm, -halvings);
    *terms = 3;
    while (term > 1e-18) term *= norm / (*terms - 2), ++*terms;
    return halvings;
}
"""


def _exponential(r: MatrixKernel, signature: str, unused: str) -> str:
    """Horner's scheme of the series and the squarings, both differentiated line by line.

    The directions of A are its entries; with X = exp(A) come X_k, and in the curvature X_P and X_kP
    of the transposed matrix along P: the sum of p_i Y_i has the slope exp'(A^T) P.
    """
    n, m = r.size, r.size * r.size
    slope, curved = r.kind is not KernelKind.EXP, r.kind is KernelKind.EXP_CURVATURE
    source = f"p[{n} * (k % {n}) + k / {n}]" if curved else "p[k]"
    arrays = [f"X[{m}] = {{0.0}}"]
    if slope:
        arrays.append(f"D[{m}][{m}] = {{{{0.0}}}}")
    if curved:
        arrays += [f"P[{m}]", f"XP[{m}] = {{0.0}}", f"DP[{m}][{m}] = {{{{0.0}}}}"]
    # direction k = (i, j) is a one in (i, j), transposed in the curvature
    i, j = (f"k % {n}", f"k / {n}") if curved else (f"k / {n}", f"k % {n}")
    lines, step, square = [], [], []
    if curved:
        lines.append(f"for (int k = 0; k < {m}; ++k) P[k] = ldexp(p[{m} + k], -halvings);")
        step += [
            f"for (int k = 0; k < {m}; ++k) {{",
            f"    double T[{m}] = {{0.0}};",
            f"    softehl_multiply({n}, by, A, DP[k], T);",
            f"    softehl_multiply({n}, by, P, D[k], T);",
            f"    for (int c = 0; c < {n}; ++c)",
            f"        T[{n} * ({i}) + c] += one * by * XP[{n} * ({j}) + c];",
            f"    softehl_move({m}, T, DP[k]);",
            "}",
        ]
        square += [
            f"for (int k = 0; k < {m}; ++k) {{",
            f"    double T[{m}] = {{0.0}};",
            f"    softehl_multiply({n}, 1.0, X, DP[k], T);",
            f"    softehl_multiply({n}, 1.0, DP[k], X, T);",
            f"    softehl_multiply({n}, 1.0, XP, D[k], T);",
            f"    softehl_multiply({n}, 1.0, D[k], XP, T);",
            f"    softehl_move({m}, T, DP[k]);",
            "}",
        ]
    if slope:
        step += [
            f"for (int k = 0; k < {m}; ++k) {{",
            f"    double T[{m}] = {{0.0}};",
            f"    softehl_multiply({n}, by, A, D[k], T);",
            f"    for (int c = 0; c < {n}; ++c)",
            f"        T[{n} * ({i}) + c] += one * by * X[{n} * ({j}) + c];",
            f"    softehl_move({m}, T, D[k]);",
            "}",
        ]
        square += [
            f"for (int k = 0; k < {m}; ++k) {{",
            f"    double T[{m}] = {{0.0}};",
            f"    softehl_multiply({n}, 1.0, X, D[k], T);",
            f"    softehl_multiply({n}, 1.0, D[k], X, T);",
            f"    softehl_move({m}, T, D[k]);",
            "}",
        ]
    if curved:
        step += [
            f"double TP[{m}] = {{0.0}};",
            f"softehl_multiply({n}, by, A, XP, TP);",
            f"softehl_multiply({n}, by, P, X, TP);",
            f"softehl_move({m}, TP, XP);",
        ]
        square += [
            f"double TP[{m}] = {{0.0}};",
            f"softehl_multiply({n}, 1.0, X, XP, TP);",
            f"softehl_multiply({n}, 1.0, XP, X, TP);",
            f"softehl_move({m}, TP, XP);",
        ]
    step += [
        f"double T[{m}] = {{0.0}};",
        f"for (int k = 0; k < {n}; ++k) T[{n + 1} * k] = 1.0;",
        f"softehl_multiply({n}, by, A, X, T);",
        f"softehl_move({m}, T, X);",
    ]
    square += [
        f"double T[{m}] = {{0.0}};",
        f"softehl_multiply({n}, 1.0, X, X, T);",
        f"softehl_move({m}, T, X);",
    ]
    if curved:
        out = [
            f"for (int e = 0, i = 0; i < {m}; ++i)",
            f"    for (int j = i; j < {m}; ++j) s[e++] = DP[j][i];",
        ]
    elif slope:
        out = [f"for (int e = 0; e < {m * m}; ++e) s[e] = D[e % {m}][e / {m}];"]
    else:
        out = [f"for (int e = 0; e < {m}; ++e) s[e] = X[e];"]
    one = "    const double one = ldexp(1.0, -halvings);\n" if slope else ""

    def block(statements: list[str], indent: int) -> str:
        return "".join(f"{'    ' * indent}{line}\n" for line in statements)

    derived = ", and its derivatives" if slope else ""
    return f"""/* Exponential of a matrix by scaling and squaring{derived}. */
{signature}{{
{unused}    double A[{m}], {", ".join(arrays)};
    int lost = 0, terms;
    for (int k = 0; k < {r.inputs}; ++k) lost |= !(fabs(p[k]) < HUGE_VAL);
    if (lost) {{
        for (int k = 0; k < {r.outputs}; ++k) s[k] = NAN;
        return 1;
    }}
    const int halvings = softehl_scaling({n}, p, &terms);
{one}    for (int k = 0; k < {m}; ++k) A[k] = ldexp({source}, -halvings);
{block(lines, 1)}    for (int k = 0; k < {n}; ++k) X[{n + 1} * k] = 1.0;
    for (int term = terms; term > 0; --term) {{
        const double by = 1.0 / term;
{block(step, 2)}    }}
    for (int k = 0; k < halvings; ++k) {{
{block(square, 2)}    }}
{block(out, 1)}    return 0;
}}
"""


# --------------------------------------------------------------------- second divided differences

_HALF_CURVATURE: dict[Op, tuple[str, str]] = {
    Op.LOG: ("-0.5 / (x * x)", "least"),
    Op.EXP: ("0.5 * exp(x)", "1.0"),
    Op.SIN: ("-0.5 * sin(x)", "1.0"),
    Op.COS: ("-0.5 * cos(x)", "1.0"),
    Op.TAN: ("tan(x) * (1.0 + tan(x) * tan(x))", "fabs(cos(v))"),
    Op.ASIN: ("0.5 * x / ((1.0 - x * x) * sqrt(1.0 - x * x))", "1.0 - most"),
    Op.ACOS: ("-0.5 * x / ((1.0 - x * x) * sqrt(1.0 - x * x))", "1.0 - most"),
    Op.ATAN: ("-x / ((1.0 + x * x) * (1.0 + x * x))", "sqrt(1.0 + least * least)"),
    Op.SINH: ("0.5 * sinh(x)", "1.0"),
    Op.COSH: ("0.5 * cosh(x)", "1.0"),
    Op.TANH: ("-tanh(x) / (cosh(x) * cosh(x))", "1.0"),
    Op.ASINH: (
        "-0.5 * x / ((1.0 + x * x) * sqrt(1.0 + x * x))",
        "sqrt(1.0 + least * least)",
    ),
    Op.ACOSH: ("-0.5 * x / ((x * x - 1.0) * sqrt(x * x - 1.0))", "least - 1.0"),
    Op.ATANH: ("x / ((1.0 - x * x) * (1.0 - x * x))", "1.0 - most"),
    Op.ERF: ("-1.1283791670955126 * x * exp(-x * x)", "1.0 / (1.0 + most)"),
    Op.ERFC: ("1.1283791670955126 * x * exp(-x * x)", "1.0 / (1.0 + most)"),
    Op.POWER: ("0.5 * p[6] * (p[6] - 1.0) * pow(x, p[6] - 2.0)", "least"),
}


def second_quotient(r: SecondQuotient, signature: str, unused: str) -> str:
    """C of f[u, v, w]: a quotient of first differences, or the mean of f'' by Gauss's rule.

    The mean has the weight of a hat above the three values; the five points of each half are
    exact to rounding where f'' changes little, which is where the quotient loses digits.
    """
    half, scale = _HALF_CURVATURE[r.op]
    return f"""/* {r.op}[u, v, w] */
{signature}{{
{unused}    static const double at[5] = {{
        0.09853508579882643, 0.3045357266463639, 0.5620251897526138, 0.8019865821263918,
        0.9601901429485312}};
    static const double weight[5] = {{
        0.031495829043384546, 0.14781774014523324, 0.2927739741693396, 0.3343492761887391,
        0.19356318045330336}};
    double x[3] = {{p[0], p[1], p[2]}}, q[3] = {{p[4], p[3], p[5]}};
    for (int i = 1; i < 3; ++i)
        for (int j = i; j > 0 && x[j] < x[j - 1]; --j) {{
            const double a = x[j], b = q[j];
            x[j] = x[j - 1], q[j] = q[j - 1], x[j - 1] = a, q[j - 1] = b;
        }}
    const double v = x[1], width = x[2] - x[0];
    const double most = fmax(fabs(x[0]), fabs(x[2]));
    const double least = x[0] * x[2] > 0.0 ? fmin(fabs(x[0]), fabs(x[2])) : 0.0;
    (void)v, (void)most, (void)least;
    if (!(width <= 0.1 * ({scale}))) {{
        s[0] = (q[0] - q[2]) / width;
        return 0;
    }}
    if (width == 0.0) {{
        const double x = v;
        s[0] = {half};
        return 0;
    }}
    const double lower = (v - x[0]) / width, upper = (x[2] - v) / width;
    s[0] = 0.0;
    for (int k = 0; k < 5; ++k) {{
        const double down = x[0] + at[k] * (v - x[0]), up = x[2] - at[k] * (x[2] - v);
        double sum = 0.0;
        if (lower > 0.0) {{
            const double x = down;
            sum += lower * ({half});
        }}
        if (upper > 0.0) {{
            const double x = up;
            sum += upper * ({half});
        }}
        s[0] += weight[k] * sum;
    }}
    return 0;
}}
"""

"""C of (f(u) - f(v)) / (u - v) for the functions of the C library.

Where the values differ by more than a quarter of their size the quotient loses two bits. Else u
and v lie close, and an addition theorem gives the difference without cancellation.
"""

from __future__ import annotations

from softehl.codegen.graph.graph import Op

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
    const double y = p[0], x = p[1], v = p[2], w = p[3], f = p[4], g = p[5];
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


def quotient(op: Op, signature: str) -> list[str]:
    """C function of a `Quotient` and what it needs, callees first."""
    if op is Op.ATAN2:
        return [_ANGLE.format(signature=signature)]
    text = f"""/* ({op}(u) - {op}(v)) / (u - v) */
{signature}{{
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

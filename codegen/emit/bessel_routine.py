"""C of reduced spherical Bessel functions of a length."""

from __future__ import annotations

from softehl.codegen.graph.bessel import Bessel

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


def text(r: Bessel, signature: str, unused: str) -> list[str]:
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

"""The hand-written part of the generated header: lanes, their masks, transposing loads and stores.

V is one value of every element of a group, M a mask of elements: all bits of a lane set, or none.
With one lane both are scalars, and nothing is padded or transposed.
"""

from softehl.codegen.emit.support_batch import ARRAYS, BATCH
from softehl.codegen.emit.support_lanes import FOUR, LANES, ROOTS
from softehl.codegen.emit.support_local import LOCAL

_VECTORS = r"""
#if SOFTEHL_LANES > 1
static inline V softehl_splat(double a)
{
#define SOFTEHL_ONE(l) a
    return (V)SOFTEHL_EACH(SOFTEHL_ONE);
#undef SOFTEHL_ONE
}

/* A function of the C library, lane by lane. */
#define SOFTEHL_LANEWISE(NAME)                              \
    static inline V softehl_v##NAME(V a)                    \
    {                                                       \
        V out;                                              \
        for (int l = 0; l < SOFTEHL_LANES; ++l) out[l] = NAME(a[l]); \
        return out;                                         \
    }
#define SOFTEHL_LANEWISE2(NAME)                             \
    static inline V softehl_v##NAME(V a, V b)               \
    {                                                       \
        V out;                                              \
        for (int l = 0; l < SOFTEHL_LANES; ++l) out[l] = NAME(a[l], b[l]); \
        return out;                                         \
    }

static inline V softehl_vpow(V a, double e)
{
    V out;
    for (int l = 0; l < SOFTEHL_LANES; ++l) out[l] = pow(a[l], e);
    return out;
}

static inline V softehl_vpower(V a, V e)
{
    V out;
    for (int l = 0; l < SOFTEHL_LANES; ++l) out[l] = pow(a[l], e[l]);
    return out;
}

static inline M softehl_mask(int set)
{
    return (M)softehl_splat(0.0) - (long long)(set != 0);
}

static inline V softehl_blend(M m, V a, V b)
{
    return (V)((m & (M)a) | (~m & (M)b));
}

static inline V softehl_vfabs(V a)
{
    return (V)((M)a & ~(M)softehl_splat(-0.0));
}

#define softehl_lt(a, b) ((M)((a) < (b)))
#define softehl_le(a, b) ((M)((a) <= (b)))
#define softehl_eq(a, b) ((M)((a) == (b)))
#define softehl_lane(a, l) ((a)[l])

/* a^(-1/3): a guess from the exponent (5 %), then two steps of fourth order. */
static inline V softehl_vrcbrt(V a)
{
    const M magic = (M)softehl_splat(0x1p52);
    const V high = (V)(((M)a >> 32) | magic) - 0x1p52;
    const V guess = 0x1p52 + (1430188287.0 - high * (1.0 / 3.0));
    V y = (V)(((M)guess) << 32);
    for (int k = 0; k < 2; ++k) {
        const V r = 1.0 - a * (y * y * y);
        y += y * (r * (1.0 / 3.0 + r * (2.0 / 9.0 + r * (14.0 / 81.0))));
    }
    return softehl_blend(softehl_lt(0.0, a), y, softehl_splat(NAN));
}

/* exp(a) = 2^k exp(r), |r| <= ln(2)/2, by Taylor's series: within 2 units of the last place. */
static inline V softehl_vexp(V a)
{
    /* k + 2048 in the last bits of a large number: no compiler can reorder this away */
    const M n = (M)(a * 0x1.71547652b82fep+0 + (0x1p52 + 2048.0)) & 0xfffLL, h = n >> 1;
    const V k = (V)(n | (M)softehl_splat(0x1p52)) - (0x1p52 + 2048.0);
    const V r = (a - k * 0x1.62e42fefap-1) - k * 0x1.cf79abc9e3b3ap-40;
    V y = r * (1.0 / 6227020800.0) + 1.0 / 479001600.0;
    y = y * r + 1.0 / 39916800.0;
    y = y * r + 1.0 / 3628800.0;
    y = y * r + 1.0 / 362880.0;
    y = y * r + 1.0 / 40320.0;
    y = y * r + 1.0 / 5040.0;
    y = y * r + 1.0 / 720.0;
    y = y * r + 1.0 / 120.0;
    y = y * r + 1.0 / 24.0;
    y = y * r + 1.0 / 6.0;
    y = y * r + 0.5;
    y = (y * r) * r + r + 1.0;
    /* 2^k as a product of two factors: the one may be too large, or subnormal */
    y *= (V)((h - 1) << 52);
    y *= (V)((n - h - 1) << 52);
    y = softehl_blend(softehl_lt(softehl_splat(709.782712893384), a), softehl_splat(HUGE_VAL), y);
    y = softehl_blend(softehl_lt(a, softehl_splat(-745.2)), softehl_splat(0.0), y);
    return softehl_blend(softehl_eq(a, a), y, a);
}

/* log(m 2^k) = k ln(2) + 2 artanh(s), s = (m - 1)/(m + 1), 1/sqrt(2) < m < sqrt(2). */
static inline V softehl_vlog(V a)
{
    const M small = softehl_lt(a, softehl_splat(0x1p-1022));
    const V scaled = softehl_blend(small, a * 0x1p54, a);
    const M bits = (M)scaled + (0x3ff0000000000000LL - 0x3fe6a09e667f3bcdLL);
    const V power = (V)((bits >> 52) | (M)softehl_splat(0x1p52)) - (0x1p52 + 1023.0);
    const V k = power - softehl_blend(small, softehl_splat(54.0), softehl_splat(0.0));
    const V m = (V)((bits & 0x000fffffffffffffLL) + 0x3fe6a09e667f3bcdLL);
    const V f = m - 1.0, s = f / (m + 1.0), z = s * s;
    V y = z * (2.0 / 21.0) + 2.0 / 19.0;
    y = y * z + 2.0 / 17.0;
    y = y * z + 2.0 / 15.0;
    y = y * z + 2.0 / 13.0;
    y = y * z + 2.0 / 11.0;
    y = y * z + 2.0 / 9.0;
    y = y * z + 2.0 / 7.0;
    y = y * z + 2.0 / 5.0;
    y = y * z + 2.0 / 3.0;
    /* 2 s = f - f s, and f is exact */
    y = k * 0x1.62e42fefap-1 + (f - (f * s - (s * z * y + k * 0x1.cf79abc9e3b3ap-40)));
    const V most = softehl_splat(HUGE_VAL), none = softehl_splat(NAN), zero = softehl_splat(0.0);
    y = softehl_blend(softehl_lt(a, most), y, a);
    y = softehl_blend(softehl_lt(zero, a), y, none);
    return softehl_blend(softehl_eq(a, zero), -most, y);
}

static inline void softehl_transpose(V *a, V *b, V *c, V *d)
{
    const V p = __builtin_shufflevector(*a, *b, SOFTEHL_EVEN);
    const V q = __builtin_shufflevector(*a, *b, SOFTEHL_ODD);
    const V r = __builtin_shufflevector(*c, *d, SOFTEHL_EVEN);
    const V s = __builtin_shufflevector(*c, *d, SOFTEHL_ODD);
    *a = __builtin_shufflevector(p, r, SOFTEHL_LOW);
    *b = __builtin_shufflevector(q, s, SOFTEHL_LOW);
    *c = __builtin_shufflevector(p, r, SOFTEHL_HIGH);
    *d = __builtin_shufflevector(q, s, SOFTEHL_HIGH);
}

static inline V softehl_column(const double *p, ptrdiff_t width)
{
#define SOFTEHL_ONE(l) p[l * width]
    return (V)SOFTEHL_EACH(SOFTEHL_ONE);
#undef SOFTEHL_ONE
}

static inline void softehl_load4(const double *p, ptrdiff_t width, V *a, V *b, V *c, V *d)
{
    *a = softehl_rows(p, width);
    *b = softehl_rows(p + width, width);
    *c = softehl_rows(p + 2 * width, width);
    *d = softehl_rows(p + 3 * width, width);
    softehl_transpose(a, b, c, d);
}

static inline void softehl_store4(double *p, ptrdiff_t width, V a, V b, V c, V d)
{
    softehl_transpose(&a, &b, &c, &d);
    softehl_put(p, width, a);
    softehl_put(p + width, width, b);
    softehl_put(p + 2 * width, width, c);
    softehl_put(p + 3 * width, width, d);
}

static inline void softehl_store1(double *p, ptrdiff_t width, V a)
{
    for (int l = 0; l < SOFTEHL_LANES; ++l) p[l * width] = a[l];
}
#else
typedef double V;
typedef long long M;
#define softehl_any(m) ((m) != 0)
#define softehl_splat(a) (a)
#define softehl_mask(set) ((set) ? -1LL : 0LL)
#define softehl_blend(m, a, b) ((m) ? (a) : (b))
#define softehl_lt(a, b) softehl_mask((a) < (b))
#define softehl_le(a, b) softehl_mask((a) <= (b))
#define softehl_eq(a, b) softehl_mask((a) == (b))
#define softehl_lane(a, l) (a)
#define softehl_vfabs(a) fabs(a)
#define softehl_vpow(a, e) pow(a, e)
#define softehl_vpower(a, e) pow(a, e)
#define softehl_vrcbrt(a) softehl_rcbrt(a)
#define softehl_vexp(a) exp(a)
#define softehl_vlog(a) log(a)
#define SOFTEHL_LANEWISE(NAME) \
    static inline double softehl_v##NAME(double a) { return NAME(a); }
#define SOFTEHL_LANEWISE2(NAME) \
    static inline double softehl_v##NAME(double a, double b) { return NAME(a, b); }

static inline double softehl_column(const double *p, ptrdiff_t width)
{
    (void)width;
    return p[0];
}

static inline void softehl_load4(
    const double *p, ptrdiff_t width, double *a, double *b, double *c, double *d)
{
    (void)width;
    *a = p[0], *b = p[1], *c = p[2], *d = p[3];
}

static inline void softehl_store4(
    double *p, ptrdiff_t width, double a, double b, double c, double d)
{
    (void)width;
    p[0] = a, p[1] = b, p[2] = c, p[3] = d;
}

static inline void softehl_store1(double *p, ptrdiff_t width, double a)
{
    (void)width;
    p[0] = a;
}
#endif

SOFTEHL_LANEWISE(sqrt)
SOFTEHL_LANEWISE(sin)
SOFTEHL_LANEWISE(cos)
SOFTEHL_LANEWISE(cbrt)

static inline void softehl_load1(const double *p, ptrdiff_t width, V *a)
{
    *a = softehl_column(p, width);
}

static inline void softehl_load2(const double *p, ptrdiff_t width, V *a, V *b)
{
    *a = softehl_column(p, width), *b = softehl_column(p + 1, width);
}

static inline void softehl_load3(const double *p, ptrdiff_t width, V *a, V *b, V *c)
{
    softehl_load2(p, width, a, b);
    *c = softehl_column(p + 2, width);
}

static inline void softehl_store2(double *p, ptrdiff_t width, V a, V b)
{
    softehl_store1(p, width, a), softehl_store1(p + 1, width, b);
}

static inline void softehl_store3(double *p, ptrdiff_t width, V a, V b, V c)
{
    softehl_store2(p, width, a, b), softehl_store1(p + 2, width, c);
}
"""

TEXT = LANES + ROOTS + FOUR + _VECTORS + ARRAYS + LOCAL + BATCH

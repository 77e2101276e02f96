"""The hand-written part of the generated header: lanes, transposing loads and stores, roots."""

LANES = r"""
/* One lane per element.  Without vector extensions a group is one element. */
#if !defined(SOFTEHL_LANES) && defined(__GNUC__) && defined(__has_builtin)
#if __has_builtin(__builtin_shufflevector)
#define SOFTEHL_LANES 4
#endif
#endif
#ifndef SOFTEHL_LANES
#define SOFTEHL_LANES 1
#endif
"""

ROOTS = r"""
/* a^(-1/3) for a > 0, not-a-number otherwise. */
static inline double softehl_rcbrt(double a)
{
    return a > 0.0 ? 1.0 / cbrt(a) : NAN;
}
"""

VECTORS = r"""
#if SOFTEHL_LANES == 4
typedef double softehl_vec __attribute__((vector_size(32)));
typedef long long softehl_bits __attribute__((vector_size(32)));
typedef double softehl_row __attribute__((vector_size(32), aligned(8)));

typedef softehl_vec V;

static inline softehl_vec softehl_splat(double a)
{
    return (softehl_vec){a, a, a, a};
}

#define SOFTEHL_LANEWISE(NAME)                                           \
    static inline softehl_vec softehl_v##NAME(softehl_vec a)             \
    {                                                                    \
        return (softehl_vec){NAME(a[0]), NAME(a[1]), NAME(a[2]), NAME(a[3])}; \
    }
SOFTEHL_LANEWISE(sqrt)
SOFTEHL_LANEWISE(log)
SOFTEHL_LANEWISE(exp)
SOFTEHL_LANEWISE(sin)
SOFTEHL_LANEWISE(cos)
SOFTEHL_LANEWISE(cbrt)

static inline softehl_vec softehl_vpow(softehl_vec a, double e)
{
    return (softehl_vec){pow(a[0], e), pow(a[1], e), pow(a[2], e), pow(a[3], e)};
}

/* a^(-1/3): a guess from the exponent (5 %), then two steps of fourth order. */
static inline softehl_vec softehl_vrcbrt(softehl_vec a)
{
    const softehl_bits magic = (softehl_bits)softehl_splat(0x1p52);
    const softehl_vec high = (softehl_vec)(((softehl_bits)a >> 32) | magic) - 0x1p52;
    const softehl_vec guess = 0x1p52 + (1430188287.0 - high * (1.0 / 3.0));
    softehl_vec y = (softehl_vec)(((softehl_bits)guess) << 32);
    for (int k = 0; k < 2; ++k) {
        const softehl_vec r = 1.0 - a * (y * y * y);
        y += y * (r * (1.0 / 3.0 + r * (2.0 / 9.0 + r * (14.0 / 81.0))));
    }
    const softehl_bits valid = a > 0.0;
    return (softehl_vec)((valid & (softehl_bits)y) | (~valid & (softehl_bits)softehl_splat(NAN)));
}

static inline void softehl_transpose(
    softehl_vec *a, softehl_vec *b, softehl_vec *c, softehl_vec *d)
{
    const softehl_vec p = __builtin_shufflevector(*a, *b, 0, 4, 2, 6);
    const softehl_vec q = __builtin_shufflevector(*a, *b, 1, 5, 3, 7);
    const softehl_vec r = __builtin_shufflevector(*c, *d, 0, 4, 2, 6);
    const softehl_vec s = __builtin_shufflevector(*c, *d, 1, 5, 3, 7);
    *a = __builtin_shufflevector(p, r, 0, 1, 4, 5);
    *b = __builtin_shufflevector(q, s, 0, 1, 4, 5);
    *c = __builtin_shufflevector(p, r, 2, 3, 6, 7);
    *d = __builtin_shufflevector(q, s, 2, 3, 6, 7);
}

static inline softehl_vec softehl_column(const double *p, ptrdiff_t width)
{
    return (softehl_vec){p[0], p[width], p[2 * width], p[3 * width]};
}

static inline void softehl_load4(
    const double *p, ptrdiff_t width, softehl_vec *a, softehl_vec *b, softehl_vec *c,
    softehl_vec *d)
{
    *a = *(const softehl_row *)p;
    *b = *(const softehl_row *)(p + width);
    *c = *(const softehl_row *)(p + 2 * width);
    *d = *(const softehl_row *)(p + 3 * width);
    softehl_transpose(a, b, c, d);
}

static inline void softehl_store4(
    double *p, ptrdiff_t width, softehl_vec a, softehl_vec b, softehl_vec c, softehl_vec d)
{
    softehl_transpose(&a, &b, &c, &d);
    *(softehl_row *)p = a;
    *(softehl_row *)(p + width) = b;
    *(softehl_row *)(p + 2 * width) = c;
    *(softehl_row *)(p + 3 * width) = d;
}

static inline void softehl_store1(double *p, ptrdiff_t width, softehl_vec a)
{
    for (int l = 0; l < 4; ++l) p[l * width] = a[l];
}
#else
typedef double softehl_vec, V;
#define softehl_splat(a) (a)
#define softehl_vsqrt(a) sqrt(a)
#define softehl_vlog(a) log(a)
#define softehl_vexp(a) exp(a)
#define softehl_vsin(a) sin(a)
#define softehl_vcos(a) cos(a)
#define softehl_vcbrt(a) cbrt(a)
#define softehl_vpow(a, e) pow(a, e)
#define softehl_vrcbrt(a) softehl_rcbrt(a)

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

static inline void softehl_load1(const double *p, ptrdiff_t width, softehl_vec *a)
{
    *a = softehl_column(p, width);
}

static inline void softehl_load2(
    const double *p, ptrdiff_t width, softehl_vec *a, softehl_vec *b)
{
    *a = softehl_column(p, width), *b = softehl_column(p + 1, width);
}

static inline void softehl_load3(
    const double *p, ptrdiff_t width, softehl_vec *a, softehl_vec *b, softehl_vec *c)
{
    softehl_load2(p, width, a, b);
    *c = softehl_column(p + 2, width);
}

static inline void softehl_store2(double *p, ptrdiff_t width, softehl_vec a, softehl_vec b)
{
    softehl_store1(p, width, a), softehl_store1(p + 1, width, b);
}

static inline void softehl_store3(
    double *p, ptrdiff_t width, softehl_vec a, softehl_vec b, softehl_vec c)
{
    softehl_store2(p, width, a, b), softehl_store1(p + 2, width, c);
}

/* Fill a group with `count` elements of `width` values and repeat the last one. */
static inline void softehl_pad(double *to, const double *from, ptrdiff_t width, ptrdiff_t count)
{
    for (ptrdiff_t e = 0; e < SOFTEHL_LANES; ++e)
        for (ptrdiff_t k = 0; k < width; ++k)
            to[e * width + k] = from[(e < count ? e : count - 1) * width + k];
}
"""

TEXT = LANES + ROOTS + VECTORS

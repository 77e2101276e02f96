"""Hand-written C runtime in the generated header: lanes, masks, batches, local iterations.

V is one value of every element of a group, M a mask of elements: all bits of a lane set, or none.
With one lane both are scalars, and nothing is padded or transposed.
"""

LANES = r"""
/* One lane per element: 8 with AVX-512, else 4.  Without vector extensions a group is one element.
   A file of kernels in which 8 lanes do not pay says SOFTEHL_MOST_LANES 4. */
#if !defined(SOFTEHL_LANES) && defined(__GNUC__) && defined(__has_builtin)
#if __has_builtin(__builtin_shufflevector)
#if defined(__AVX512F__) && !defined(SOFTEHL_MOST_LANES)
#define SOFTEHL_LANES 8
#else
#define SOFTEHL_LANES 4
#endif
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

FOUR = r"""
#if SOFTEHL_LANES > 1
typedef double V __attribute__((vector_size(8 * SOFTEHL_LANES)));
typedef long long M __attribute__((vector_size(8 * SOFTEHL_LANES)));
typedef double softehl_four __attribute__((vector_size(32)));
typedef double softehl_row __attribute__((vector_size(32), aligned(8)));
typedef long long softehl_half __attribute__((vector_size(32)));

/* Whether any lane of a mask is set. */
static inline int softehl_any4(softehl_half m)
{
#ifdef __AVX__
    return __builtin_ia32_movmskpd256((softehl_four)m) != 0;
#else
    return ((m[0] | m[1]) | (m[2] | m[3])) != 0;
#endif
}
#endif

#if SOFTEHL_LANES == 4
#define SOFTEHL_EACH(F) {F(0), F(1), F(2), F(3)}
#define SOFTEHL_EVEN 0, 4, 2, 6
#define SOFTEHL_ODD 1, 5, 3, 7
#define SOFTEHL_LOW 0, 1, 4, 5
#define SOFTEHL_HIGH 2, 3, 6, 7
#define softehl_any(m) softehl_any4(m)

static inline V softehl_rows(const double *p, ptrdiff_t width)
{
    (void)width;
    return *(const softehl_row *)p;
}

static inline void softehl_put(double *p, ptrdiff_t width, V a)
{
    (void)width;
    *(softehl_row *)p = a;
}
#elif SOFTEHL_LANES == 8
#define SOFTEHL_EACH(F) {F(0), F(1), F(2), F(3), F(4), F(5), F(6), F(7)}
#define SOFTEHL_EVEN 0, 8, 2, 10, 4, 12, 6, 14
#define SOFTEHL_ODD 1, 9, 3, 11, 5, 13, 7, 15
#define SOFTEHL_LOW 0, 1, 8, 9, 4, 5, 12, 13
#define SOFTEHL_HIGH 2, 3, 10, 11, 6, 7, 14, 15

static inline int softehl_any(M m)
{
    return softehl_any4(__builtin_shufflevector(m, m, 0, 1, 2, 3) |
                        __builtin_shufflevector(m, m, 4, 5, 6, 7));
}

/* The rows of lanes l and l + 4, four values each. */
static inline V softehl_rows(const double *p, ptrdiff_t width)
{
    const softehl_four a = *(const softehl_row *)p, b = *(const softehl_row *)(p + 4 * width);
    return __builtin_shufflevector(a, b, 0, 1, 2, 3, 4, 5, 6, 7);
}

static inline void softehl_put(double *p, ptrdiff_t width, V a)
{
    *(softehl_row *)p = __builtin_shufflevector(a, a, 0, 1, 2, 3);
    *(softehl_row *)(p + 4 * width) = __builtin_shufflevector(a, a, 4, 5, 6, 7);
}
#endif
"""


ARRAYS = r"""
/* Rows of `width` values of the elements of a group, to one V for each value and back. */
static inline void softehl_gather(V *to, const double *from, ptrdiff_t width)
{
    ptrdiff_t k = 0;
    for (; k + 4 <= width; k += 4)
        softehl_load4(from + k, width, to + k, to + k + 1, to + k + 2, to + k + 3);
    for (; k < width; ++k) to[k] = softehl_column(from + k, width);
}

static inline void softehl_scatter(double *to, const V *from, ptrdiff_t width)
{
    ptrdiff_t k = 0;
    for (; k + 4 <= width; k += 4)
        softehl_store4(to + k, width, from[k], from[k + 1], from[k + 2], from[k + 3]);
    for (; k < width; ++k) softehl_store1(to + k, width, from[k]);
}

/* Not-a-number for all values of the elements in which something failed. */
static inline void softehl_spoil(M failed, double *p, ptrdiff_t width)
{
    for (int l = 0; l < SOFTEHL_LANES; ++l)
        for (ptrdiff_t k = 0; k < width && softehl_lane(failed, l) != 0; ++k)
            p[l * width + k] = NAN;
}

/* Fill a group with `count` elements of `width` values and repeat the last one. */
static inline void softehl_pad(double *to, const double *from, ptrdiff_t width, ptrdiff_t count)
{
    for (ptrdiff_t e = 0; e < SOFTEHL_LANES; ++e)
        for (ptrdiff_t k = 0; k < width; ++k)
            to[e * width + k] = from[(e < count ? e : count - 1) * width + k];
}
"""

BATCH = r"""
#define SOFTEHL_KERNEL(NAME)                                                        \
    void NAME(ptrdiff_t n, ptrdiff_t points, ptrdiff_t modes,                       \
        const double *restrict coordinates, const double *restrict dofs,            \
        const double *restrict data, const double *restrict parameters,             \
        const double *restrict direction, const double *restrict rule,              \
        const double *restrict basis, double *restrict values, double *restrict tangent)

/* What computes as many elements as there are lanes: several are never printed into the loop over
   groups. */
#if defined(__GNUC__) && SOFTEHL_LANES > 1
#define SOFTEHL_APART static __attribute__((noinline))
#else
#define SOFTEHL_APART static
#endif
#define SOFTEHL_GROUP(NAME)                                                         \
    SOFTEHL_APART void NAME##_group(ptrdiff_t points, ptrdiff_t modes,              \
        const double *restrict X, const double *restrict d, const double *restrict a, \
        const double *restrict t, const double *restrict parameters,                \
        const double *restrict rule, const double *restrict basis,                  \
        double *restrict R, double *restrict K)
#define SOFTEHL_IDLE                                                                \
    (void)points, (void)modes, (void)X, (void)d, (void)a, (void)t,                  \
    (void)parameters, (void)rule, (void)basis, (void)R, (void)K

/* The kernel of a batch around the function of a group: values of an element in its arrays.
   A wide one has its room for tangents apart from the stack. */
#define SOFTEHL_BATCH(NAME, ...) SOFTEHL_BATCH_IN(0, NAME, __VA_ARGS__)
#define SOFTEHL_WIDE_BATCH(NAME, X, D, A, T, R, K)                                  \
    static _Thread_local double NAME##_room[SOFTEHL_LANES * K];                     \
    SOFTEHL_BATCH_IN(NAME##_room, NAME, X, D, A, T, R, K)
#define SOFTEHL_BATCH_IN(ROOM, NAME, ...)                                           \
    SOFTEHL_KERNEL(NAME)                                                            \
    {                                                                               \
        const softehl_widths wide = {__VA_ARGS__};                                  \
        softehl_batch(NAME##_group, ROOM, wide, n, points, modes, coordinates, dofs, data, \
            parameters, direction, rule, basis, values, tangent);                   \
    }

typedef struct {
    ptrdiff_t X, d, a, t, R, K;
} softehl_widths;

typedef void softehl_group(
    ptrdiff_t points, ptrdiff_t modes, const double *X, const double *d, const double *a,
    const double *t, const double *parameters, const double *rule, const double *basis, double *R,
    double *K);

/* Full groups, the last one moved back so that it ends with the batch (the same values are written
   again); a batch smaller than a group is filled up with its last element. */
#ifdef __GNUC__
__attribute__((always_inline))
#endif
static inline void softehl_batch(
    softehl_group *group, double *room, softehl_widths wide, ptrdiff_t n, ptrdiff_t points,
    ptrdiff_t modes, const double *coordinates, const double *dofs, const double *data,
    const double *parameters, const double *direction, const double *rule, const double *basis,
    double *values, double *tangent)
{
#define SOFTEHL_AT(p, w) ((w) ? (p) + (w) * e : 0)
    (void)room;
    if (n < 1) return;
    for (ptrdiff_t next = 0; n >= SOFTEHL_LANES && next < n; next += SOFTEHL_LANES) {
        const ptrdiff_t e = next + SOFTEHL_LANES <= n ? next : n - SOFTEHL_LANES;
        group(points, modes, SOFTEHL_AT(coordinates, wide.X), SOFTEHL_AT(dofs, wide.d),
            SOFTEHL_AT(data, wide.a), SOFTEHL_AT(direction, wide.t), parameters, rule, basis,
            SOFTEHL_AT(values, wide.R), SOFTEHL_AT(tangent, wide.K));
    }
#undef SOFTEHL_AT
#if SOFTEHL_LANES > 1
    if (n >= SOFTEHL_LANES) return;
#define SOFTEHL_ROOM(w) SOFTEHL_LANES * (w) + 1
    double X[SOFTEHL_ROOM(wide.X)], d[SOFTEHL_ROOM(wide.d)], a[SOFTEHL_ROOM(wide.a)];
    double t[SOFTEHL_ROOM(wide.t)], R[SOFTEHL_ROOM(wide.R)], stack[SOFTEHL_ROOM(room ? 0 : wide.K)];
#undef SOFTEHL_ROOM
    double *const K = room ? room : stack;
    softehl_pad(X, coordinates, wide.X, n), softehl_pad(d, dofs, wide.d, n);
    softehl_pad(a, data, wide.a, n), softehl_pad(t, direction, wide.t, n);
    group(points, modes, X, d, a, t, parameters, rule, basis, R, K);
    for (ptrdiff_t i = 0; i < wide.R * n; ++i) values[i] = R[i];
    for (ptrdiff_t i = 0; i < wide.K * n; ++i) tangent[i] = K[i];
#endif
}
"""


LOCAL = """
/* What cancels in an equation: the sum of |slope * value| over the local unknowns
   and all that comes from outside. */
static inline V softehl_terms_lanes(int n, const V *A, const V *s, int m, const V *B, const V *p)
{
    V terms = softehl_splat(0.0);
    for (int k = 0; k < n; ++k) terms += softehl_vfabs(A[k] * s[k]);
    for (int k = 0; k < m; ++k) {
        const V term = softehl_vfabs(B[k] * p[k]);
        terms += softehl_blend(softehl_lt(term, softehl_splat(HUGE_VAL)), term, softehl_splat(0.0));
    }
    return terms;
}

/* Solve A x = b for `count` columns b in place, with partial pivoting in every lane
   for itself; returns the lanes in which A is singular. */
static inline M softehl_eliminate_lanes(int n, V *A, int count, V *b)
{
    M singular = softehl_mask(0);
    for (int k = 0; k < n; ++k) {
        for (int i = k + 1; i < n; ++i) {
            const M larger = softehl_lt(softehl_vfabs(A[k * n + k]), softehl_vfabs(A[i * n + k]));
            if (!softehl_any(larger)) continue;
            for (int j = k; j < n; ++j) {
                const V x = A[k * n + j], y = A[i * n + j];
                A[k * n + j] = softehl_blend(larger, y, x);
                A[i * n + j] = softehl_blend(larger, x, y);
            }
            for (int j = 0; j < count; ++j) {
                const V x = b[k * count + j], y = b[i * count + j];
                b[k * count + j] = softehl_blend(larger, y, x);
                b[i * count + j] = softehl_blend(larger, x, y);
            }
        }
        singular |= ~softehl_lt(softehl_splat(0.0), softehl_vfabs(A[k * n + k]));
        A[k * n + k] = 1.0 / A[k * n + k];
        for (int i = k + 1; i < n; ++i) {
            const V factor = A[i * n + k] * A[k * n + k];
            for (int j = k + 1; j < n; ++j) A[i * n + j] -= factor * A[k * n + j];
            for (int j = 0; j < count; ++j) b[i * count + j] -= factor * b[k * count + j];
        }
    }
    for (int k = n - 1; k >= 0; --k)
        for (int j = 0; j < count; ++j) {
            for (int i = k + 1; i < n; ++i) b[k * count + j] -= A[k * n + i] * b[i * count + j];
            b[k * count + j] *= A[k * n + k];
        }
    return singular;
}
"""


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

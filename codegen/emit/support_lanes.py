"""C of the header: how many lanes there are, and what differs between four and eight of them."""

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

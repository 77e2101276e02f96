"""C of the header for batches: arrays of elements to lanes and back, groups, what is left."""

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

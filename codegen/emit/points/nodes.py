"""Unknowns of nodes to lanes and back, for products: a row of memory for each lane, transposed."""

from __future__ import annotations

GROUP = 8
"""Elements whose node numbers stand together, whatever the lanes of the processor."""

SUPPORT = r"""
#if SOFTEHL_LANES > 1
typedef double softehl_wide __attribute__((vector_size(8 * SOFTEHL_LANES), aligned(8)));
typedef double softehl_two __attribute__((vector_size(16), aligned(8)));

#if SOFTEHL_LANES == 8
#define SOFTEHL_ROWS(x, at, l) __builtin_shufflevector( \
    *(const softehl_row *)((x) + (at)[l]), *(const softehl_row *)((x) + (at)[(l) + 4]), \
    0, 1, 2, 3, 4, 5, 6, 7)
#define SOFTEHL_HALVES 2
#define softehl_part(v, h) ((h) ? __builtin_shufflevector(v, v, 4, 5, 6, 7) \
    : __builtin_shufflevector(v, v, 0, 1, 2, 3))
#else
#define SOFTEHL_ROWS(x, at, l) (*(const softehl_row *)((x) + (at)[l]))
#define SOFTEHL_HALVES 1
#define softehl_part(v, h) (v)
#endif

/* Four values from the place of every lane on. */
static inline void softehl_take(const double *x, const int *at, V *a, V *b, V *c, V *d)
{
    *a = SOFTEHL_ROWS(x, at, 0);
    *b = SOFTEHL_ROWS(x, at, 1);
    *c = SOFTEHL_ROWS(x, at, 2);
    *d = SOFTEHL_ROWS(x, at, 3);
    softehl_transpose(a, b, c, d);
}

/* Add `count` of the four values to the place of every lane. */
static inline void softehl_give(double *y, const int *at, const int count, V a, V b, V c, V d)
{
    softehl_transpose(&a, &b, &c, &d);
    const V rows[4] = {a, b, c, d};
#pragma GCC unroll 2
    for (int h = 0; h < SOFTEHL_HALVES; ++h) {
#pragma GCC unroll 4
        for (int l = 0; l < 4; ++l) {
            const softehl_four row = softehl_part(rows[l], h);
            double *const to = y + at[4 * h + l];
            if (count == 4) *(softehl_row *)to += row;
            if (count == 2 || count == 3)
                *(softehl_two *)to += __builtin_shufflevector(row, row, 0, 1);
            if (count == 3) to[2] += row[2];
            if (count == 1) to[0] += row[0];
        }
    }
}
#else
typedef double softehl_wide;

static inline void softehl_take(const double *x, const int *at, V *a, V *b, V *c, V *d)
{
    const double *const from = x + at[0];
    *a = from[0], *b = from[1], *c = from[2], *d = from[3];
}

static inline void softehl_give(double *y, const int *at, const int count, V a, V b, V c, V d)
{
    double *const to = y + at[0];
    const V row[4] = {a, b, c, d};
    for (int k = 0; k < count; ++k) to[k] += row[k];
}
#endif
"""


def gather(components: int, nodes: int) -> list[str]:
    """Lines that take values of the nodes to u[component][node], and call for those of `next`."""
    lines = ["V idle[4];", "(void)idle;"]
    lines.append(f"for (int a = 0; a < {nodes}; ++a) {{")
    for first in range(0, components, 4):
        names = [
            f"&u[{c}][a]" if c < components else f"&idle[{c - first}]"
            for c in range(first, first + 4)
        ]
        lines.append(f"    softehl_take(x + {first}, index + {GROUP} * a, {', '.join(names)});")
    lines.append("    for (int l = 0; l < SOFTEHL_LANES; ++l) {")
    for array in ("x", "y"):
        lines.append(f"        __builtin_prefetch({array} + next[{GROUP} * a + l]);")
    return [*lines, "    }", "}"]


def scatter(components: int, nodes: int) -> list[str]:
    """Lines that add u[component][node] to the nodes."""
    lines = [f"for (int a = 0; a < {nodes}; ++a) {{"]
    for first in range(0, components, 4):
        count = min(4, components - first)
        names = [f"u[{first + min(k, count - 1)}][a]" for k in range(4)]
        lines.append(
            f"    softehl_give(y + {first}, index + {GROUP} * a, {count}, {', '.join(names)});"
        )
    return [*lines, "}"]

"""C of the header for local iterations: sizes of terms and elimination, in lanes."""

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

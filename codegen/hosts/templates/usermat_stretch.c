/* Right stretch U = R^T F, row by row; F by columns. False where F has no rotation. */
static int stretch(const double *F, double *U)
{
    double R[9], C[9], change = 1.0;
    for (int k = 0; k < 9; ++k)
        R[k] = F[k];
    for (int step = 0; step < 60 && change > 1e-15; ++step) {
        for (int i = 0; i < 3; ++i)
            for (int j = 0; j < 3; ++j) { /* cofactors */
                const int a = (i + 1) % 3, b = (i + 2) % 3, c = (j + 1) % 3, d = (j + 2) % 3;
                C[i + 3 * j] = R[a + 3 * c] * R[b + 3 * d] - R[a + 3 * d] * R[b + 3 * c];
            }
        const double det = R[0] * C[0] + R[3] * C[3] + R[6] * C[6];
        if (!(det > 0.0) || !finite_numbers(&det, 1))
            return 0;
        const double g = step < 8 ? 1.0 / cbrt(det) : 1.0; /* Higham's scaled iteration */
        change = 0.0;
        for (int k = 0; k < 9; ++k) {
            const double next = 0.5 * (g * R[k] + C[k] / (det * g));
            change = fmax(change, fabs(next - R[k]));
            R[k] = next;
        }
    }
    for (int i = 0; i < 3; ++i)
        for (int j = 0; j < 3; ++j) {
            double sum = 0.0;
            for (int k = 0; k < 3; ++k)
                sum += 0.5 * (R[k + 3 * i] * F[k + 3 * j] + R[k + 3 * j] * F[k + 3 * i]);
            U[3 * i + j] = sum;
        }
    return 1;
}


/* Prints the seconds of a call of UEL of docs/models/neo_hooke.py, the least of many runs. */
#include <stdio.h>
#include <time.h>
void uel_();
void xit_(void) {}
int main(void)
{
    double rhs[8], k[64], s[24] = {0}, e[8], p[2] = {0.4, 1.2}, X[8] = {1, 1, 2, 1, 2, 2, 1, 2};
    double u[8] = {0, .01, .02, -.01, .03, .02, 0, .01}, t[2] = {1, 1}, dt = 1, cut = 1, best = 1;
    int n = 8, one = 1, stored = 1, props = 2, dim = 2, nodes = 4, none = 0, flags[5] = {1, 1, 1};
    for (int run = 0; run < 50; ++run) {
        struct timespec a, b;
        clock_gettime(CLOCK_MONOTONIC, &a);
        for (int i = 0; i < 1000; ++i)
            uel_(rhs, k, s, e, &n, &one, &stored, p, &props, X, &dim, &nodes, u, u, u, u, &one, t,
                &dt, &one, &one, &one, t, &none, &none, t, t, &one, flags, &n, t, &none, &cut,
                &none, &none, &dt);
        clock_gettime(CLOCK_MONOTONIC, &b);
        const double seconds = (b.tv_sec - a.tv_sec) + 1e-9 * (b.tv_nsec - a.tv_nsec);
        best = seconds / 1000 < best ? seconds / 1000 : best;
    }
    printf("%.9f", best);
}

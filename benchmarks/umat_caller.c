/* Prints the seconds of a call of UMAT of docs/models/creep_law.py, the least of many runs. */
#include <stdio.h>
#include <time.h>
void umat_();
void xit_(void) {}
int main(void)
{
    double s[6], v[6] = {0}, c[36], o[9] = {0}, t[2] = {1, 1}, dt = 0.1, p[4] = {0.4, 2, 0.6, 2};
    double F[9] = {1.1, 0.05, -0.1, 0.2, 0.9, 0.1, -0.1, 0.15, 1.2}, cut = 1, best = 1;
    int three = 3, six = 6, four = 4, one = 1;
    for (int run = 0; run < 50; ++run) {
        struct timespec a, b;
        clock_gettime(CLOCK_MONOTONIC, &a);
        for (int i = 0; i < 1000; ++i) {
            for (int k = 0; k < 6; ++k)
                v[k] = 0.01 * k;
            umat_(s, v, c, o, o, o, o, o, o, o, o, o, t, &dt, o, o, o, o, "CREEPING", &three,
                &three, &six, &six, p, &four, o, o, &cut, o, F, F, &one, &one, &one, &one, &one,
                &one, (size_t)8);
        }
        clock_gettime(CLOCK_MONOTONIC, &b);
        const double seconds = (b.tv_sec - a.tv_sec) + 1e-9 * (b.tv_nsec - a.tv_nsec);
        best = seconds / 1000 < best ? seconds / 1000 : best;
    }
    printf("%.9f", cut < 1 ? -1 : best);
}

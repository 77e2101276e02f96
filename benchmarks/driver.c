/* What measures: thread CPU time of repeated calls, and the multiply-add peak of this core. */
#define _POSIX_C_SOURCE 200809L
#include <stddef.h>
#include <time.h>

typedef void kernel(
    ptrdiff_t n, const double *coordinates, const double *dofs, const double *parameters,
    double *values, double *tangent);

static double now(void)
{
#ifdef CLOCK_THREAD_CPUTIME_ID
    struct timespec t;
    clock_gettime(CLOCK_THREAD_CPUTIME_ID, &t);
    return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
#else
    return (double)clock() / CLOCKS_PER_SEC;
#endif
}

/* Seconds of `repeats` calls, after one that is not counted and brings the arrays into cache. */
double bench_seconds(
    kernel *call, ptrdiff_t repeats, ptrdiff_t n, const double *coordinates, const double *dofs,
    const double *parameters, double *values, double *tangent)
{
    call(n, coordinates, dofs, parameters, values, tangent);
    const double start = now();
    for (ptrdiff_t k = 0; k < repeats; ++k)
        call(n, coordinates, dofs, parameters, values, tangent);
    return now() - start;
}

/* Enough independent chains to hide the latency of two pipes, few enough for the registers. */
#define CHAINS 12
#if defined(__GNUC__) && defined(__AVX512F__)
#define LANES 8
#elif defined(__GNUC__) && defined(__AVX__)
#define LANES 4
#elif defined(__GNUC__)
#define LANES 2
#else
#define LANES 1
#endif
#if LANES > 1
typedef double vec __attribute__((vector_size(8 * LANES)));
#else
typedef double vec;
#endif

/* Operations per second of `steps` multiply-adds on each chain (a multiply-add is two). */
double bench_peak(ptrdiff_t steps, const double *start, double *sink)
{
    vec a[CHAINS], zero = {0};
    for (int k = 0; k < CHAINS; ++k) a[k] = zero + (start[0] + k);
    const vec m = zero + start[1], c = zero + start[2];
    const double begin = now();
    for (ptrdiff_t s = 0; s < steps; ++s) {
#pragma GCC unroll 12
        for (int k = 0; k < CHAINS; ++k) a[k] = a[k] * m + c;
    }
    const double seconds = now() - begin;
    vec total = zero;
    for (int k = 0; k < CHAINS; ++k) total += a[k];
    *(vec *)sink = total;
    return 2.0 * LANES * CHAINS * (double)steps / seconds;
}

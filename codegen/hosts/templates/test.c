/* Test of @name@: values from its page (samples.h), and derivatives against differences. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "@name@.h"
#include "samples.h"

enum {
    N = 9, /* elements of a call: more than the lanes of a processor, and no multiple of them */
    COORDINATES = @NAME@_NODES * @NAME@_DIMENSION,
    UNKNOWNS = @NAME@_UNKNOWNS,
    DATA = @NAME@_DATA + @NAME@_POINTS * @NAME@_POINT_DATA,
    FIELDS = @NAME@_POINTS * @NAME@_FIELDS
};

static double X[N * COORDINATES + 1], u[N * UNKNOWNS], data[N * DATA + 1];
static int failures;

/* Copy the samples one after another to N elements. */
static void spread(double *to, const double *from, int width)
{
    for (int e = 0; e < N; ++e)
        memcpy(to + e * width, from + (e % SAMPLES) * width, (size_t)width * sizeof(double));
}

/* Largest difference over the largest value; each of n rows belongs to the sample e % SAMPLES. */
static double off(const double *found, const double *expected, int width, int n)
{
    double most = 0.0, error = 0.0;
    for (int k = 0; k < SAMPLES * width; ++k)
        most = fmax(most, fabs(expected[k]));
    for (int e = 0; e < n; ++e)
        for (int k = 0; k < width; ++k) {
            const double d = fabs(found[e * width + k] - expected[(e % SAMPLES) * width + k]);
            error = d <= error ? error : d; /* not-a-number stays */
        }
    return most > 0.0 ? error / most : error;
}

static void say(const char *what, double error, double limit)
{
    const int good = error <= limit;
    printf("%-36s %.1e  %s\n", what, error, good ? "ok" : "FAILED");
    failures += !good;
}

static void *numbers(size_t count)
{
    void *array = calloc(count + 1, sizeof(double));
    if (array == NULL)
        exit(2);
    return array;
}

@checks@
int main(void)
{
    spread(X, sample_X, COORDINATES);
    spread(u, sample_u, UNKNOWNS);
    spread(data, sample_data, DATA);
@calls@    return failures != 0;
}

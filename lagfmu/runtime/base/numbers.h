/* numbers.h -- comparisons that the runtime needs everywhere; none of them calls a library. */
#ifndef LAGFMU_NUMBERS_H
#define LAGFMU_NUMBERS_H

#include <math.h>
#include <stddef.h>

static inline double larger(double a, double b) { return a > b ? a : b; }

static inline double smaller(double a, double b) { return a < b ? a : b; }

static inline size_t larger_size(size_t a, size_t b) { return a > b ? a : b; }

/* The largest |a_i| of a (n); 0 without any. */
static inline double largest(int n, const double *a) {
    double most = 0;
    for (int i = 0; i < n; i++) most = fmax(most, fabs(a[i]));
    return most;
}

#endif

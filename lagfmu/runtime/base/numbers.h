/* numbers.h -- what the runtime does with numbers and arrays everywhere. */
#ifndef LAGFMU_NUMBERS_H
#define LAGFMU_NUMBERS_H

#include <math.h>
#include <stddef.h>

static const double TURN = 6.283185307179586477; /* [rad] */

static inline double larger(double a, double b) { return a > b ? a : b; }

static inline double smaller(double a, double b) { return a < b ? a : b; }

static inline size_t larger_size(size_t a, size_t b) { return a > b ? a : b; }

/* The largest |a_i| of a (n); 0 without any. */
static inline double largest(int n, const double *a) {
    double most = 0;
    for (int i = 0; i < n; i++) most = fmax(most, fabs(a[i]));
    return most;
}

static inline double dot(int n, const double *a, const double *b) {
    double sum = 0;
    for (int i = 0; i < n; i++) sum += a[i] * b[i];
    return sum;
}

/* to (n) <- to + part a. */
static inline void add_part(int n, double part, const double *a, double *to) {
    for (int i = 0; i < n; i++) to[i] += part * a[i];
}

#endif

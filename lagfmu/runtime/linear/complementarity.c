/* complementarity.c -- 0 <= z  _|_  w = A z + b >= 0  for a symmetric positive semidefinite A: linear
 * complementarity.
 *
 * These are the conditions of the quadratic program  min z^T A z / 2 + b^T z, z >= 0  (Cottle, Pang &
 * Stone, The Linear Complementarity Problem, 1992, sect. 1.2), solved by the dual active set method
 * (Goldfarb & Idnani, Math. Programming 27 (1983) 1): the most violated w joins the set that is held at
 * zero, and those whose z would turn negative leave it.  The set stays independent, so dependent rows do
 * no harm; w is unique, whatever the order of the rows. */
#include "complementarity.h"

#include <math.h>

#include "lu.h"

static const double LCP_ZERO = 1e-12;     /* of the terms of A z + b in scaled rows: a w that counts as none */
static const double LCP_DEPENDENT = 1e-10; /* of a row of unit norm that must stand out to join the set */

typedef struct {
    int n, count;       /* rows, and how many of them are held at w = 0 */
    int *held, *pivots; /* (n) */
    double *A, *b, *z;
    double *factor, *r; /* (n * n), (n) */
} Problem;

static double gap(const Problem *p, int j) {
    double sum = p->b[j];
    for (int i = 0; i < p->n; i++) sum += p->A[j * p->n + i] * p->z[i];
    return sum;
}

/* Rows of unit diagonal: A <- D^-1 A D^-1, b <- D^-1 b, D^2 = diag(A); returns D in d. */
static void scale(Problem *p, double *d) {
    for (int i = 0; i < p->n; i++) {
        const double a = p->A[i * p->n + i];
        d[i] = a > 0 ? sqrt(a) : 1;
    }
    for (int i = 0; i < p->n; i++) {
        p->b[i] /= d[i];
        for (int j = 0; j < p->n; j++) p->A[i * p->n + j] = p->A[i * p->n + j] / d[i] / d[j];
    }
}

/* r: how the held z answer a unit of z_j; returns what is left of A_jj. */
static double respond(Problem *p, int j) {
    const int k = p->count;
    double left = p->A[j * p->n + j];
    for (int a = 0; a < k; a++) {
        p->r[a] = p->A[p->held[a] * p->n + j];
        for (int c = 0; c < k; c++) p->factor[a * k + c] = p->A[p->held[a] * p->n + p->held[c]];
    }
    if (lu_factor(k, p->factor, p->pivots) != 0) return 0; /* the set is independent */
    lu_solve(k, p->factor, p->pivots, p->r);
    for (int a = 0; a < k; a++) left -= p->A[j * p->n + p->held[a]] * p->r[a];
    return left;
}

/* Raises z_j until w_j = 0, w staying 0 on the set; 0 if that cannot be. */
static int join(Problem *p, int j) {
    for (;;) {
        const double left = respond(p, j);
        const double full = left > LCP_DEPENDENT ? -gap(p, j) / left : HUGE_VAL;
        double way = HUGE_VAL;
        int leaves = 0;
        for (int a = 0; a < p->count; a++) {
            if (!(p->r[a] > LCP_DEPENDENT) || !(p->z[p->held[a]] / p->r[a] < way)) continue;
            way = p->z[p->held[a]] / p->r[a];
            leaves = a;
        }
        const double step = fmin(way, full);
        if (!(step < HUGE_VAL)) return 0;
        for (int a = 0; a < p->count; a++) p->z[p->held[a]] -= step * p->r[a];
        p->z[j] += step;
        if (full <= way) {
            p->held[p->count++] = j;
            return 1;
        }
        p->z[p->held[leaves]] = 0;
        p->count -= 1;
        for (int a = leaves; a < p->count; a++) p->held[a] = p->held[a + 1];
    }
}

/* w, 0 on the set; the row that violates w >= 0 most.  `floor`: what rounding leaves of the terms of A z + b,
 * which nearly parallel rows make much larger than b. */
static int most_violated(const Problem *p, double *w, double *floor) {
    int least = 0;
    *floor = 0;
    for (int i = 0; i < p->n; i++) {
        double terms = fabs(p->b[i]);
        for (int j = 0; j < p->n; j++) terms += fabs(p->A[i * p->n + j]) * p->z[j];
        *floor = fmax(*floor, LCP_ZERO * terms);
        w[i] = gap(p, i);
    }
    for (int a = 0; a < p->count; a++) w[p->held[a]] = 0;
    for (int i = 1; i < p->n; i++)
        if (w[i] < w[least]) least = i;
    return least;
}

int complementarity_solve(int n, double *A, double *b, double *z, double *w, double *work,
                          int *iwork) {
    Problem p = {n, 0, iwork, iwork + n, A, b, z, work, work + n * n};
    double *d = p.r + n, floor;
    scale(&p, d);
    for (int i = 0; i < n; i++) z[i] = 0;
    for (int round = 0; round < 50 * (n + 1); round++) {
        const int j = most_violated(&p, w, &floor);
        if (n == 0 || w[j] >= -floor) {
            for (int i = 0; i < n; i++) {
                z[i] /= d[i];
                w[i] = fabs(w[i]) <= floor ? 0 : w[i] * d[i];
            }
            return 1;
        }
        if (!join(&p, j)) return 0;
    }
    return 0;
}

/* ldlt.h -- sparse A = L D L^T without square roots, in an order and a pattern found beforehand. */
#ifndef LAGFMU_LDLT_H
#define LAGFMU_LDLT_H

#include "linkage.h"
#include "plan.h"

/* What is known of the condition of a matrix that was factored. */
typedef struct {
    double bound;  /* of its 2-norm condition number, scaled to a unit diagonal: never below it */
    double norm;   /* of the norm of the scaled matrix */
    double growth; /* largest A_pp / D_p: how much of a diagonal element cancelled at worst */
    int failed;    /* position whose pivot is not positive and finite (bound: infinity), or -1 */
} Definite;

/* Scratch (size) of the bounds: of a row of L^-1 R its squared norm s, in a forest, or else its norm; 1 / R and the sums
 * of |C|, which a forest does not ask for; a row of L, zero between calls. */
typedef struct {
    double *size, *scale, *norm, *row;
} Bounds;

/* begin (start[size]): where row i of L, i = column[k], comes to the first column of the row that holds k.  What it has
 * before meets only zeros there: in a chain that is half of it. */
SHARED void ldlt_begins(const Elimination *e, int *begin);

/* In place: on entry L holds A's elements below the diagonal in the pattern of L and D its
 * diagonal, in the order of elimination; on return L, and 1 / D.  `acts` (size; NULL: all): 0 for what is passed
 * over, a row of A, by its own number, that is nothing but a 1 on the diagonal. */
SHARED Definite ldlt_factor(const Elimination *e, const int *begin, double *L, double *D, const Bounds *own,
                            const int *acts);

/* Scratch of ldlt_trace(): derivatives of log det A by the elements of L (its pattern; over D of the column), D and y
 * (size); a row of L (size), zero on entry and return. */
typedef struct {
    double *by_L, *by_D, *by_y, *l;
} Reverse;

/* sum_i A_ii (A^-1)_ii, the trace of the inverse of A scaled to a unit diagonal, from its factors L and D = 1 / D;
 * `diagonal` (size): A_ii by A's own numbers. */
SHARED double ldlt_trace(const Elimination *e, const int *begin, const double *L, const double *D,
                         const double *diagonal, const int *acts, const Reverse *x);

/* y <- L^-1 y */
SHARED void ldlt_forward(const Elimination *e, const double *L, double *y);

/* y <- L^-T y */
SHARED void ldlt_backward(const Elimination *e, const double *L, double *y);

#endif

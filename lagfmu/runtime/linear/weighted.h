/* weighted.h -- orthogonal decomposition of W = D^-1/2 L^-1 P G^T, the constraints in the metric of
 * M. */
#ifndef LAGFMU_WEIGHTED_H
#define LAGFMU_WEIGHTED_H

#include "cod.h"
#include "linear.h"
#include "linkage.h"

/* W (n, rows that act), its columns of unit norm. */
typedef struct {
    Cod cod;
    double *size;          /* (m) norm that each column had */
    double *y, *w, *spare; /* (nv), (m), (m) */
    int *rank;             /* of W */
    int *rows;             /* (acting) which rows act */
    int acting;
    int hides;             /* 1: in a row a light coordinate leaves next to nothing of others that take part in it;
                            * known right after weighted_factor() alone */
} Weighted;

/* Doubles and ints that it needs in Linear.dense and Linear.pivots. */
SHARED size_t weighted_doubles(int n, int m);
SHARED int weighted_ints(int n, int m);

/* Columns that stand out by at most `threshold` count as dependent.  0 if M is not safely positive
 * definite. */
SHARED int weighted_factor(Linear *l, double threshold, Weighted *w);

/* The decomposition that weighted_factor() left. */
SHARED Weighted weighted_view(const Linear *l);

/* y (nv) <- Q^T D^-1/2 L^-1 P b ;  x <- P^T L^-T D^-1/2 Q y (y is lost) */
SHARED void weighted_to(const Linear *l, const Weighted *w, const double *b, double *y);
SHARED void weighted_from(const Linear *l, const Weighted *w, double *y, double *x);

/* w->w <- T^-1 Z1^T c above Z2^T c, c being scaled as the columns of W. */
SHARED void weighted_rows(const Weighted *w, const double *c);

/* x, and the lambda of least norm. */
SHARED void weighted_solve(Linear *l, const double *b, const double *c, double *x, double *lambda);

#endif

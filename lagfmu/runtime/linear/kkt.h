/* kkt.h -- dense LU of the scaled KKT matrix of the rows that act, with refinement. */
#ifndef LAGFMU_KKT_H
#define LAGFMU_KKT_H

#include "linear.h"
#include "linkage.h"

/* Doubles and ints that it needs in Linear.dense and Linear.pivots, N = n + m. */
SHARED size_t kkt_doubles(int n, int m);
SHARED int kkt_ints(int n, int m);

/* Writes scale * K * scale (N, N), K = [[M, G^T], [G, 0]] of the rows that act, to A; row k of G
 * stands at place[k].  Returns N. */
SHARED int kkt_matrix(const Linear *l, const double *scale, const int *place, double *A);

/* 1 if the matrix is regular to working precision. */
SHARED int kkt_factor(Linear *l, double least);

SHARED void kkt_solve(Linear *l, const double *b, const double *c, double *x, double *lambda);

#endif

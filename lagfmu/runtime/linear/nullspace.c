/* nullspace.c -- lambda eliminated from M x = b + G^T lambda (ME 6590, eq. 9):  with G N = 0,
 *
 *   N^T (M x - b) = 0 ,   G x = c ,
 *
 * and lambda recovered afterwards from G^T lambda = M x - b.  The columns of N = L^-T D^-1/2 Q2
 * (weighted.c) are orthonormal in the metric of M, N^T M x = Q2^T z, N^T b = Q2^T y: for
 * independent rows these are the equations that weighted_solve() solves. */
#include "nullspace.h"

#include "weighted.h"

static const double SAFE = 1e-6; /* rows of unit norm must stand out by this much */

int nullspace_factor(Linear *l) {
    Weighted w;
    if (!weighted_factor(l, SAFE, &w)) return 0;
    return w.acting > 0 && w.cod.rank == w.acting;
}

void nullspace_solve(Linear *l, const double *b, const double *c, double *x, double *lambda) {
    weighted_solve(l, b, c, x, lambda);
}

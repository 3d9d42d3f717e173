/* complementarity.h -- 0 <= z  _|_  w = A z + b >= 0  for a symmetric positive semidefinite A. */
#ifndef LAGFMU_COMPLEMENTARITY_H
#define LAGFMU_COMPLEMENTARITY_H

#include "linkage.h"

/* Doubles and ints of workspace for n rows. */
static inline int complementarity_doubles(int n) { return n * n + 2 * n; }
static inline int complementarity_ints(int n) { return 2 * n; }

/* z and w (n); a w that counts as none is 0.  A (n * n) and b (n) are lost.  Returns 0 if there is no
 * solution. */
SHARED int complementarity_solve(int n, double *A, double *b, double *z, double *w, double *work,
                                 int *iwork);

#endif

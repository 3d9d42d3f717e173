/* condition.h -- 1-norm of the inverse of a symmetric matrix of which only A^-1 x can be had. */
#ifndef LAGFMU_CONDITION_H
#define LAGFMU_CONDITION_H

#include "linkage.h"

/* Estimate of || A^-1 ||_1 for symmetric A (n, n): a lower bound, seldom below a third of it;
 * infinity if A^-1 x is not finite.  solve(context, x): x <- A^-1 x.  `work` (2 n). */
SHARED double inverse_norm(int n, void (*solve)(void *context, double *x), void *context, double *work);

#endif

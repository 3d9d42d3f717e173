/* orthogonal.h -- dependent constraints: multipliers of least norm, and which are unique. */
#ifndef LAGFMU_ORTHOGONAL_H
#define LAGFMU_ORTHOGONAL_H

#include "linear.h"
#include "linkage.h"

/* 1 if M is safely positive definite; clears l->unique where lambda is not.  `doubtful`: rows that seem to
 * depend on each other may do so only because a coordinate is so heavy that it hides in the metric of M. */
SHARED int orthogonal_factor(Linear *l, int *doubtful);

/* FAILED: the constraints contradict each other. */
SHARED Status orthogonal_solve(Linear *l, const double *b, const double *c, double *x, double *lambda);

#endif

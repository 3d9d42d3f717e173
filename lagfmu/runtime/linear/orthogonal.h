/* orthogonal.h -- dependent constraints: multipliers of least norm, and which are unique. */
#ifndef LAGFMU_ORTHOGONAL_H
#define LAGFMU_ORTHOGONAL_H

#include "linear.h"

/* 1 if M is safely positive definite; clears l->unique where lambda is not. */
int orthogonal_factor(Linear *l);

/* FAILED: the constraints contradict each other. */
Status orthogonal_solve(Linear *l, const double *b, const double *c, double *x, double *lambda);

#endif

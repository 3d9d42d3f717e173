/* nullspace.h -- lambda eliminated by a basis of the null space of G, orthonormal in the metric of
 * M. */
#ifndef LAGFMU_NULLSPACE_H
#define LAGFMU_NULLSPACE_H

#include "linear.h"
#include "linkage.h"

/* 1 if M is safely definite and the rows that act, at least one, are safely independent. */
SHARED int nullspace_factor(Linear *l);

SHARED void nullspace_solve(Linear *l, const double *b, const double *c, double *x, double *lambda);

#endif

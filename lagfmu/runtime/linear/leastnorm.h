/* leastnorm.h -- dependent constraints and a massless coordinate: least norm of the KKT matrix. */
#ifndef LAGFMU_LEASTNORM_H
#define LAGFMU_LEASTNORM_H

#include "linear.h"
#include "linkage.h"

/* Doubles and ints that it needs in Linear.dense and Linear.pivots. */
SHARED size_t least_norm_doubles(int n, int m);
SHARED int least_norm_ints(int n, int m);

/* Clears l->unique where lambda is not unique.  FAILED: the mass matrix is singular on the
 * constraint surface. */
SHARED Status least_norm_factor(Linear *l);

/* FAILED: the constraints contradict each other. */
SHARED Status least_norm_solve(Linear *l, const double *b, const double *c, double *x, double *lambda);

#endif

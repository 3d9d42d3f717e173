/* dependent.h -- the rungs of linear.c that only constraints need: rows of G that depend on each
 * other, and the null space of G. */
#ifndef LAGFMU_DEPENDENT_H
#define LAGFMU_DEPENDENT_H

#include "linear.h"
#include "linkage.h"

typedef struct {
    /* Doubles and ints that they need in Linear.dense and Linear.pivots. */
    size_t (*doubles)(int n, int m);
    size_t (*ints)(int n, int m);
    /* lambda eliminated, if that is safe at this state. */
    int (*nullspace)(Linear *l);
    /* orthogonal.c, or leastnorm.c where M is singular; FAILED: so it is on the constraint surface. */
    Status (*factor)(Linear *l);
    /* By the rung that was factored.  FAILED: the constraints contradict each other. */
    Status (*solve)(Linear *l, const double *b, const double *c, double *x, double *lambda);
    /* See linear_basis(); of the rung that was factored, whose factors are lost. */
    int (*basis)(Linear *l, int *basis);
} Dependent;

/* NULL in an FMU without constraints: its optional.c says so, and dependent.c is not there. */
SHARED const Dependent *const DEPENDENT;

#endif

/* extreme.h -- the largest value of a function between two points. */
#ifndef LAGFMU_EXTREME_H
#define LAGFMU_EXTREME_H

#include "linkage.h"
#include "root.h"

/* The largest value in [a, b] next to x in (a, b), whose value is not below those at both ends, to within
 * `tolerance` of its place; x and at_x are replaced. */
SHARED Status extreme_find(Height height, void *context, double a, double b, double tolerance, double *x,
                           double *at_x);

#endif

/* root.h -- a zero of a function between two points at which its signs differ. */
#ifndef LAGFMU_ROOT_H
#define LAGFMU_ROOT_H

#include "linkage.h"
#include "status.h"

/* The function whose zero is sought; FAILED where it cannot be evaluated. */
typedef Status (*Height)(void *context, double x, double *value);

/* A zero in [a, b] to within `tolerance` and rounding, given the values at both ends (one of them is
 * not positive, the other is not negative). */
SHARED Status root_find(Height height, void *context, double a, double at_a, double b, double at_b,
                        double tolerance, double *root);

#endif

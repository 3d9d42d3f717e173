/* residual.h -- what x and lambda leave of both equations, on the rows that act. */
#ifndef LAGFMU_RESIDUAL_H
#define LAGFMU_RESIDUAL_H

#include "linear.h"
#include "linkage.h"

/* r = b + G^T lambda - M x (n) and g = c - G x (m; 0 where a row does not act), in working
 * precision. b may be NULL (zero). */
SHARED void linear_residual(const Linear *l, const double *b, const double *c, const double *x,
                            const double *lambda, double *r, double *g);

/* The same for x + x_low and lambda + lambda_low, each product and sum in doubled precision.
 * `r_low` is scratch (n). */
SHARED void residual_doubled(const Linear *l, const double *b, const double *c, const double *x,
                             const double *x_low, const double *lambda, const double *lambda_low,
                             double *r, double *r_low, double *g);

/* z + z_low <- z + z_low + d */
SHARED void doubled_move(int n, double *z, double *z_low, const double *d);

/* Solves with right-hand sides b, c for x, lambda, by factors that are not exact. */
typedef void (*Substitute)(Linear *l, const double *b, const double *c, double *x, double *lambda);

/* Three steps of refinement in doubled precision of the solution x, lambda. */
SHARED void refine(Linear *l, Substitute substitute, const double *b, const double *c, double *x,
                   double *lambda);

#endif

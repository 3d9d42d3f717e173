/* magnitudes.h -- what is large and what is small in a motion: sizes, natural rate, error scales. */
#ifndef LAGFMU_MAGNITUDES_H
#define LAGFMU_MAGNITUDES_H

#include "solver.h"

extern const double TOUCH; /* |f| below this, relative to its own terms: touching */

/* least (n): for each coordinate the largest parameter of its dimension; 0 for an angle. */
void magnitudes_extents(const System *s, const double *p, double *least);

/* state.size at q; 0 where there is none.  Before: the sizes before q was projected, or 0. */
void magnitudes_sizes(Solver *s, const double *q);

/* 1 while a size, or the rate, is not known. */
int magnitudes_incomplete(const Solver *s);

/* Sizes, rate, scales and gaps as far as they can be known; scales only grow.  `stepped` holds the
 * motion at the state and instant; span [s]: of the first step, or 0 while there is none.  FAILED if one
 * is not finite. */
Status magnitudes_complete(Solver *s, Instant at, double span);

#endif

/* companion.h -- a run beside the delivered one, at a coarser tolerance, for its error bars (bars.c). */
#ifndef LAGFMU_COMPANION_H
#define LAGFMU_COMPANION_H

#include "solver.h"

/* A companion's step that the run beside it could take as well, since its end was given and not chosen (an
 * input may change there): the two would not differ.  The estimated error of such a step stays in it. */
void companion_coarsen(const Solver *s, Integrator *i);

/* Have both runs met the same events, and stand in the same modes? */
int companion_paired(const Solver *a, const Solver *b);

#endif

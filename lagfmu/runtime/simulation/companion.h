/* companion.h -- a run beside the delivered one, at a coarser tolerance, for its error bars (bars.c). */
#ifndef LAGFMU_COMPANION_H
#define LAGFMU_COMPANION_H

#include "solver.h"

/* solver.alike of a companion: the next step of dop853 is h_next = 0.9 h err^(-1/8), so that a step with
 * h_next > alike h would be accepted at a tolerance `coarser` times finer too.  Of the delivered run: infinite. */
double companion_alike(double coarser);

/* After a step of either run, before it is projected.
 *
 * The local error of a method of order p grows with h^(p + 1): its sum over the steps, in units of the
 * motion's natural time, is kept in state.now.local.
 *
 * A companion's step that the run beside it could take as well, since its end was given and not chosen (an
 * input may change there), or since steps are still growing, would not differ: its estimated error stays in
 * it, that of dense output at t in what is read within it (2 n). */
void companion_after_step(Solver *s, Integrator *i);
void companion_inside(const Solver *s, const Integrator *i, double t, double *y);

/* How much larger the local errors of a companion b are than those of the run a beside it; at least 1. */
double companion_ratio(const Solver *a, const Solver *b);

/* Have both runs met the same events, and stand in the same modes? */
int companion_paired(const Solver *a, const Solver *b);

#endif

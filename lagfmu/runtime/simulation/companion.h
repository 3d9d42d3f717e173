/* companion.h -- a run beside the delivered one, at a coarser tolerance, for its error bars (bars.c). */
#ifndef LAGFMU_COMPANION_H
#define LAGFMU_COMPANION_H

#include "solver.h"

/* solver.alike of a companion: the next step of dop853 is h_next = 0.9 h err^(-1/8), so that a step with
 * h_next > alike h would be accepted at a tolerance `coarser` times finer too.  Of the delivered run: infinite. */
double companion_alike(double coarser);

/* After a step of either run, before it is projected.
 *
 * The local error of a method of order p grows with h^(p + 1): its sum over the steps and the largest, in units
 * of the motion's natural time, are kept in state.now.local.
 *
 * A companion's step that the run beside it could take as well, since its end was given and not chosen (an
 * input may change there), or since steps are still growing, would not differ: its estimated error stays in
 * it, that of dense output at t in what is read within it (2 n). */
void companion_after_step(Solver *s, Integrator *i);

/* The same after a step of a trial that looks for an event; and at the event, where the way there counts in
 * place of the whole step that it lies in. */
void companion_at_trial(Solver *s, Integrator *i);
void companion_at_event(Solver *s);

void companion_inside(const Solver *s, const Integrator *i, double t, double *y);

/* The part of the difference between a run a and its companion b that is the bar: the companion's local errors
 * are r times as large, of which `margin` / r is left, at most 1; where the largest of them are those of N
 * steps, and may cancel by chance, it is 1 + few / N times as much. */
double companion_share(const Solver *a, const Solver *b, double margin, double few);

/* Have both runs met the same events, and stand in the same modes? */
int companion_paired(const Solver *a, const Solver *b);

#endif

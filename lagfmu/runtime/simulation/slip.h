/* slip.h -- what is watched of frictions within a step, and what slip takes away: of FRICTION_EVENTS. */
#ifndef LAGFMU_SLIP_H
#define LAGFMU_SLIP_H

#include "indicators.h"
#include "linkage.h"
#include "solver.h"

SHARED void slip_indicators(const Solver *s, double *values);
SHARED Range slip_range(const Solver *s, int which);
SHARED int slip_turns(const Solver *s);
SHARED Status slip_turn(Solver *s, double t, const double *y);
SHARED double slip_power(const Solver *s);
SHARED void slip_observe(const Solver *s, Observed *o);
SHARED Status slip_work(Solver *s, double t0, double t1, double *lost);
SHARED Status slip_jacobian(Solver *s, double t, const double *y, double *J, double *dfdt);

#endif

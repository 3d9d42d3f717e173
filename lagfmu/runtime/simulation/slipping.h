/* slipping.h -- what is watched of frictions within a step, and what slipping takes away: members of SLIDES. */
#ifndef LAGFMU_SLIPPING_H
#define LAGFMU_SLIPPING_H

#include "indicators.h"
#include "linkage.h"
#include "solver.h"

SHARED void slipping_indicators(const Solver *s, double *values);
SHARED Range slipping_range(const Solver *s, int which);
SHARED int slipping_turns(const Solver *s);
SHARED Status slipping_turn(Solver *s, double t, const double *y);
SHARED Status slipping_work(Solver *s, double t0, double t1, double *lost);
SHARED Status slipping_jacobian(Solver *s, double t, const double *y, double *J, double *dfdt);

#endif

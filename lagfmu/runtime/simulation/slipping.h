/* slipping.h -- what is watched of frictions within a step, and what slipping takes away: members of SLIDES. */
#ifndef LAGFMU_SLIPPING_H
#define LAGFMU_SLIPPING_H

#include "indicators.h"
#include "solver.h"

void slipping_indicators(const Solver *s, double *values);
Range slipping_range(const Solver *s, int which);
int slipping_turns(const Solver *s);
Status slipping_turn(Solver *s, double t, const double *y);
Status slipping_work(Solver *s, double t0, double t1, double *lost);
Status slipping_jacobian(Solver *s, double t, const double *y, double *J, double *dfdt);

#endif

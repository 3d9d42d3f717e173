/* losses.h -- the energy that a projection takes. */
#ifndef LAGFMU_LOSSES_H
#define LAGFMU_LOSSES_H

#include "linkage.h"
#include "solver.h"

SHARED void losses_layout(Solver *s, Arena *scratch);

/* s->state moved onto the rows in s->active (mechanism_project); what that takes counts as dissipated: of its
 * velocities, and, if `drifted`, of its positions, which an integrator has carried off the constraints. */
SHARED Status losses_project(Solver *s, Instant at, int drifted);

/* Kinetic and potential energy [J] of the state; 0 where the equations do not say it. */
SHARED double losses_energy(const Solver *s, Instant at);

#endif

/* rattle.h -- symmetric steps of a mechanism with position constraints, for long horizons. */
#ifndef LAGFMU_RATTLE_H
#define LAGFMU_RATTLE_H

#include "integrator.h"
#include "linkage.h"
#include "mechanism.h"

/* Dense output and memory of rattle; its `step` is NULL, rattle_step() stands in for it. */
SHARED const Method rattle;

/* One step of the separable system b->system (`separable` in system.h), y = [q; v], from i->t
 * towards t_bound: a fixed step that divides the way there evenly, backwards if t_bound lies
 * before.  u is held during the step; p are the parameters; `active` are the rows that act, on
 * f = offset (m; NULL: on f = 0).  Fills i as the other methods do.  FAILED: as before the call. */
SHARED Status rattle_step(Integrator *i, Mechanism *b, const int *active, const double *offset,
                          const double *u, const double *p, const Control *control, double t_bound);

#endif

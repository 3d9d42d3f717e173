/* switches.h -- forces that jump at surfaces h(q, t, u) = 0, or, with floor, wherever h is a whole number.
 *
 * Between two events the forces are evaluated on one side of each surface: they read not h but its state,
 * which stands behind the inputs in u,
 *
 *   sign, Heaviside, conditions   -1, 0 or 1, the sign of h      floor   n + 1/2 for n <= h < n + 1
 *
 * so that they are smooth.  h is an indicator (indicators.h): where it leaves the range of its state, the
 * state changes.  At 0 a motion rests on the surface, or has just been set there. */
#ifndef LAGFMU_SWITCHES_H
#define LAGFMU_SWITCHES_H

#include "indicators.h"
#include "linkage.h"
#include "solver.h"

/* Reached by OPTIONAL (optional.h) where forces jump. */
typedef struct {
    void (*layout)(Solver *s, Arena *scratch);
    /* The states that belong to h at (at, q), state.switch_state and those behind the inputs in s->u alike; on a
     * surface that of the side to which the motion goes with v and vdot (may be NULL).  `changed` (may be
     * NULL): 1 if one is not what it was. */
    void (*settle)(Solver *s, Instant at, const double *q, const double *v, const double *vdot,
                   int *changed);
    /* 1 if a state is not the one that belongs to h at (at, q), which is on no surface. */
    int (*stale)(Solver *s, Instant at, const double *q);
    /* The states after surfaces were passed; way (switches): 1 upwards, -1 downwards, 0 not passed. */
    void (*pass)(Solver *s, const int *way);
    /* The range of h in which the state of switch k holds. */
    Range (*range)(const Solver *s, int k);
} Switches;

SHARED const Switches SWITCHES;

#endif

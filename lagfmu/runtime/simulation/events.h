/* events.h -- the first indicator that leaves its range within a step just taken; reached by OPTIONAL
 * (optional.h) where there is something to watch. */
#ifndef LAGFMU_EVENTS_H
#define LAGFMU_EVENTS_H

#include "linkage.h"
#include "solver.h"

/* find: looks through the step of s->integrator (dense output prepared, y not yet projected), which ends at
 * the projected y1.  If an indicator leaves its range, state.now.event_time and
 * state.left say when and which; event_count is 0 otherwise, and the contacts that have risen above
 * their gap are armed.  state.indicator moves on to the end of the step. */
typedef struct {
    void (*layout)(Solver *s, Arena *scratch);
    Status (*find)(Solver *s, const double *y1);
} Events;

SHARED const Events EVENTS;

#endif

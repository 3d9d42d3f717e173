/* event_search.h -- the times within a step at which the indicators are looked at. */
#ifndef LAGFMU_EVENT_SEARCH_H
#define LAGFMU_EVENT_SEARCH_H

#include "linkage.h"
#include "solver.h"

enum { SEARCH_FIRST = 4, SEARCH_MOST = 512, SEARCH_DIPS = 3 }; /* in a step; parabolas drawn through a dip */

/* Times t[0] < ... < t[count - 1] and the indicators then, a row of values for each sample. */
typedef struct {
    int count;
    double *t, *values;
} Samples;

/* Doubles behind t and values, one row of scratch among them. */
static inline int event_search_doubles(int indicators) {
    return (SEARCH_MOST + indicators) * (1 + indicators) + indicators;
}

/* Of events.c, event_search.c and minimum_gap.c. */
struct SearchMemory {
    double *y;      /* (3 solver_width()) */
    double *values; /* (indicators + event_search_doubles()) */
    double *boxes;  /* (minimum_gap_doubles()) */
};

/* Fills `samples` for the step of s->integrator (dense output prepared), from state.indicator at its start
 * to the projected y1 at its end.  y (3 states): scratch. */
SHARED Status event_search(Solver *s, const double *y1, double *y, Samples *samples);

#endif

/* peaks.h -- the extremes of quantities over the motion so far, between communication points too. */
#ifndef LAGFMU_PEAKS_H
#define LAGFMU_PEAKS_H

#include "linkage.h"
#include "solver.h"

/* Of s->peaks quantities, which s->measure knows.  All of it is reached by one pointer (optional.h), NULL in an
 * FMU without any. */
typedef struct {
    int (*doubles)(int peaks, int states); /* of scratch */
    /* The values at the state of now count; `first`: nothing has before. */
    Status (*here)(Solver *s, int first);
    /* The step just taken counts from where it has done so as far as t; y: the state there, NULL where the
     * integrator says it.  The state of now stays. */
    Status (*pass)(Solver *s, double t, const double *y);
    /* Model exchange: a step from where this was called last, or `here`, to the state of now.  Only extremes on the
     * way count; `event` becomes 1 if one passed its record by more than the tolerance. */
    Status (*step)(Solver *s, int *event);
} Peaks;

/* What is kept of quantity k, in s->peak. */
typedef enum { PEAK_MAX, PEAK_MIN, PEAK_MAX_TIME, PEAK_MIN_TIME, PEAK_PARTS } PeakPart;

/* Doubles to be saved, the last one the time [s] as far as all has counted. */
static inline int peaks_saved(int peaks) { return peaks > 0 ? PEAK_PARTS * peaks + 1 : 0; }

SHARED const Peaks PEAKS;

#endif

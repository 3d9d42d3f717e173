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

/* Where a record stands that is the latest point that has counted: whether it is one is not known before the motion
 * goes on.  At the start it is one. */
typedef enum { PEAK_SETTLED, PEAK_OPEN, PEAK_BEGUN } PeakStanding;

/* Doubles to be saved: the parts; their changes by each of `columns` (peak_changes.c) and the PeakStanding of largest
 * and smallest, if there are columns; the time [s] as far as all has counted. */
static inline int peaks_saved(int peaks, int columns) {
    return peaks > 0 ? (PEAK_PARTS * (1 + columns) + (columns > 0 ? 2 : 0)) * peaks + 1 : 0;
}

/* (PEAK_PARTS) of quantity k; their changes by column c. */
static inline double *peak_record(const Solver *s, int k) { return s->peak + PEAK_PARTS * k; }
static inline double *peak_change(const Solver *s, int c, int k) {
    return s->peak + PEAK_PARTS * (s->peaks * (1 + c) + k);
}
static inline double *peak_standing(const Solver *s, int k, PeakPart part) {
    return peak_change(s, s->peak_columns, 0) + 2 * k + (part == PEAK_MAX ? 0 : 1);
}

SHARED const Peaks PEAKS;

#endif

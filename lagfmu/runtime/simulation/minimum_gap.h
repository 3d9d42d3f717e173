/* minimum_gap.h -- can an indicator have left its range between two samples? */
#ifndef LAGFMU_MINIMUM_GAP_H
#define LAGFMU_MINIMUM_GAP_H

#include "event_search.h"
#include "linkage.h"

/* What is known between the samples k and k + 1. */
typedef enum {
    CLEAR,    /* nothing leaves its range */
    BRACKETS, /* something has left it at sample k + 1, and left it once */
    UNKNOWN   /* more has to be looked at */
} MinimumGap;

/* y (3 states): scratch. */
SHARED MinimumGap minimum_gap(Solver *s, const Samples *samples, int k, double *y);

/* Doubles of its boxes. */
static inline int minimum_gap_doubles(const System *s) {
    return s->bounds == NULL ? 0 : 2 * system_states(s) + 5 * (s->inputs + s->switches) + 2 * (s->contacts + s->switches);
}

#endif

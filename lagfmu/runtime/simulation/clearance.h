/* clearance.h -- can an indicator have left its range between two samples? */
#ifndef LAGFMU_CLEARANCE_H
#define LAGFMU_CLEARANCE_H

#include "linkage.h"
#include "samples.h"

/* What is known between the samples k and k + 1. */
typedef enum {
    CLEAR,    /* nothing leaves its range */
    BRACKETS, /* something has left it at sample k + 1, and left it once */
    UNKNOWN   /* more has to be looked at */
} Clearance;

/* y (3 * 2 n): scratch. */
SHARED Clearance clearance_between(Solver *s, const Samples *samples, int k, double *y);

/* Doubles of its boxes. */
static inline int clearance_doubles(const System *s) {
    return s->bounds == NULL ? 0 : 4 * s->n + 5 * (s->inputs + s->jumps) + 2 * (s->contacts + s->jumps);
}

#endif

/* derivatives.h -- the outputs sensitivity.OUTPUT.by.PARAMETER: derivatives of what an FMU reports, by parameters and
 * start values, along the run and through its events (variation.h).
 *
 * All of it is reached by one pointer, NULL in an FMU of which none are asked. */
#ifndef LAGFMU_DERIVATIVES_H
#define LAGFMU_DERIVATIVES_H

#include "arena.h"
#include "linkage.h"
#include "sensitivity.h"
#include "status.h"

struct Instance;
struct Variable;

typedef struct {
    int (*of_peaks)(int columns); /* by how many of them extremes are differentiated, ... */
    const void *changes;          /* ... and by whom (peaks.h) */
    void (*layout)(struct Instance *x, Arena *scratch);
    /* Columns at the start that has been found. */
    Status (*start)(struct Instance *x);
    Status (*get)(struct Instance *x, const struct Variable *v, double *value);
    /* Why derivatives ended, once. */
    void (*tell)(struct Instance *x);
} Derivatives;

SHARED const Derivatives OF_RUN;

/* Everything along column c; the variable whose derivative stands at position j, or NULL. */
SHARED Status derivatives_along(struct Instance *x, int c, Direction *d);
SHARED const struct Variable *derivatives_of(int j);

#endif

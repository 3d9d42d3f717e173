/* derivatives.h -- the outputs sensitivity.OUTPUT.by.PARAMETER: derivatives of what an FMU reports, by parameters and
 * start values, along the run and through its events (variation.h).
 *
 * All of it is reached by one pointer, NULL in an FMU of which none are asked. */
#ifndef LAGFMU_DERIVATIVES_H
#define LAGFMU_DERIVATIVES_H

#include "arena.h"
#include "linkage.h"
#include "status.h"

struct Instance;
struct Variable;

typedef struct {
    /* Before any layout: are extremes differentiated? */
    void (*prepare)(struct Instance *x);
    void (*layout)(struct Instance *x, Arena *scratch);
    /* Columns at the start that has been found. */
    Status (*start)(struct Instance *x);
    /* What was derived belongs to a state that is no longer observed. */
    void (*observed)(struct Instance *x);
    Status (*get)(struct Instance *x, const struct Variable *v, double *value);
    /* Why derivatives ended, once. */
    void (*tell)(struct Instance *x);
} Derivatives;

SHARED const Derivatives OF_RUN;

#endif

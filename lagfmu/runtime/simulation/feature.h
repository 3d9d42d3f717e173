/* feature.h -- what an FMU does beside the smooth motion: a row of FEATURES each (generated: those that the scene asks
 * for, in the order in which they act).  Nothing else names one.  A member that is NULL has nothing to do. */
#ifndef LAGFMU_FEATURE_H
#define LAGFMU_FEATURE_H

#include "solver.h"

typedef struct Feature {
    void *(*layout)(Solver *s, Arena *saved, Arena *scratch); /* its own memory; NULL while it is counted */
    int everywhere;                                           /* 1: it looks at each step and communication point */
    Status (*start)(Solver *s);                               /* the consistent start has been found */
    Status (*pass)(Solver *s, double t, const double *y);     /* within the step just taken the motion counts as far as t;
                                                               * y: the state there, NULL where the integrator says it */
    void (*before)(Solver *s);                                /* modes are about to change, ... */
    Status (*after)(Solver *s);                               /* ... they have, or may have */
    Status (*exchanged)(Solver *s, int *event);               /* an importer's step is done; `event`: it asks for one */
    const char *(*flaw)(const Solver *s, int started, int exchange, double *value); /* of a saved state; NULL: none */
    const double *(*value)(const Solver *s, int place, int index);     /* of a variable at a place of its own; NULL: none */
} Feature;

SHARED const Feature *const *const FEATURES; /* NULL behind the last */
enum { FEATURES_MOST = 8 };

/* Each that has the function, in turn, until one fails. */
#define FEATURES_DO(s, function, ...)                                              \
    do                                                                             \
        for (const Feature *const *f = (s)->features; f != NULL && *f != NULL; f++) \
            if ((*f)->function != NULL && (*f)->function(__VA_ARGS__) != OK) return FAILED; \
    while (0)

static inline int features_everywhere(const Solver *s) {
    for (const Feature *const *f = s->features; f != NULL && *f != NULL; f++)
        if ((*f)->everywhere) return 1;
    return 0;
}

/* What `layout` returned. */
static inline void *feature_own(const Solver *s, const Feature *feature) {
    for (int k = 0; s->features != NULL && s->features[k] != NULL; k++)
        if (s->features[k] == feature) return s->own[k];
    return NULL;
}

#endif

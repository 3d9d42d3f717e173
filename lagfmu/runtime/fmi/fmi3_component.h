/* fmi3_component.h -- an instance with what an importer of FMI 3.0 gives it. */
#ifndef LAGFMU_FMI3_COMPONENT_H
#define LAGFMU_FMI3_COMPONENT_H

#include "component.h"
#include "dependencies.h"
#include "fmi3.h"
#include "fmi3_calls.h"

/* Of dvdot and dlambda in a sum of variables, and of b and c, by which it changes with these (fmi3_adjoint.c). */
typedef struct {
    double *vdot, *lambda, *b, *c; /* (nv), (m), (nv), (m) */
} Weights;

typedef struct {
    Component common; /* first, so that either is found from the other */
    fmi3InstanceEnvironment environment;
    fmi3LogMessageCallback log;
    fmi3IntermediateUpdateCallback update;
    int early; /* 1: a step may return before its end */
    Weights stepped, full; /* in the coordinates that are stepped, and in all where these are others */
    double *first, *column, *gradient, **member; /* b and c along a direction, which, derivatives; those of a group */
} Component3;

/* The groups of variables that there are; fmi3_values.c. */
SHARED const Group FLOAT64, CLOCK;

/* fmi3_between.c: what the importer named to be exchanged within steps; FAILED: it cannot be, and why. */
SHARED Status component3_name(Component3 *made, const char *function, const fmi3ValueReference references[],
                              size_t count, Why *why);

SHARED void component3_layout(Component3 *made, Arena *arena); /* fmi3_adjoint.c */

#endif

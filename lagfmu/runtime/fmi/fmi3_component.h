/* fmi3_component.h -- an instance with what an importer of FMI 3.0 gives it. */
#ifndef LAGFMU_FMI3_COMPONENT_H
#define LAGFMU_FMI3_COMPONENT_H

#include "adjoint.h"
#include "component.h"
#include "fmi3.h"
#include "fmi3_calls.h"

typedef struct {
    Component common; /* first, so that either is found from the other */
    fmi3InstanceEnvironment environment;
    fmi3LogMessageCallback log;
    fmi3IntermediateUpdateCallback update;
    int early; /* 1: a step may return before its end */
    Directions directions;
} Component3;

/* The groups of variables that there are; fmi3_values.c. */
SHARED const Group FLOAT64, CLOCK;

/* fmi3_between.c: what the importer named to be exchanged within steps; FAILED: it cannot be, and why. */
SHARED Status component3_name(Component3 *made, const char *function, const fmi3ValueReference references[],
                              size_t count, Why *why);

/* An array that an importer gives has as many values as it says, one a variable; 1: it has not, and the log says
 * so. */
SHARED int component3_miscounts(Component *c, const Call *call, size_t values, size_t variables);

#endif

/* dependencies.h -- what variables depend on, and what arrays hold; interface.c is generated from the same table as modelDescription.xml. */
#ifndef LAGFMU_DEPENDENCIES_H
#define LAGFMU_DEPENDENCIES_H

#include "linkage.h"

/* The variable of that value reference depends on those of KNOWNS[first], ..., `count` of them. */
typedef struct {
    unsigned reference;
    int first, count;
} Unknown;

typedef struct {
    const Unknown *rows;
    int count;
} Unknowns;

SHARED const int DEPENDENCIES_TOLD; /* 0: of a large mechanism they are left out: each may depend on all */
SHARED const Unknowns INITIAL_UNKNOWNS, RUNNING_UNKNOWNS; /* before the end of the initialization, and after it */
SHARED const Unknowns ARRAYS; /* likewise: what is in the array of that value reference, VARIABLE_COUNT and on */
SHARED const unsigned *const KNOWNS;

#endif

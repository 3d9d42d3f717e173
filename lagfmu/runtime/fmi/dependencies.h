/* dependencies.h -- what variables depend on, and what arrays hold; interface.c is generated from the same table as modelDescription.xml. */
#ifndef LAGFMU_DEPENDENCIES_H
#define LAGFMU_DEPENDENCIES_H

#include "linkage.h"

/* Lists of value references one behind the other, each behind its length, numbered from 1. */
SHARED const unsigned *const LISTS;

/* The number of the list of what each variable depends on, before the end of the initialization and after it; 0: it is
 * no unknown of the model structure there. */
SHARED const unsigned *const INITIAL_LISTS, *const RUNNING_LISTS;
SHARED const int DEPENDENCIES_TOLD; /* 0: of a large mechanism they are left out: each may depend on all */

/* That of what each array holds, of the value references VARIABLE_COUNT and on. */
SHARED const unsigned *const ARRAY_LISTS;
SHARED const int ARRAY_COUNT;

static inline const unsigned *list_at(unsigned number) {
    const unsigned *list = LISTS;
    while (--number > 0) list += 1 + *list;
    return list;
}

#endif

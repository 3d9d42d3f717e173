/* dependencies.h -- what variables depend on, and what arrays hold; interface.c is generated from the same table as modelDescription.xml. */
#ifndef LAGFMU_DEPENDENCIES_H
#define LAGFMU_DEPENDENCIES_H

#include "component.h"
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

/* Values of scalars and arrays; NULL where all are scalars. */
typedef int GetArrays(Component *c, const Call *call, const Group *group, const unsigned references[], size_t count,
                      double values[], size_t value_count);
SHARED GetArrays get_arrays;
SHARED GetArrays *const ARRAYS;

/* An array that an importer gives has as many values as it says, one a variable; 1: it has not, and the log says
 * so. */
SHARED int component3_miscounts(Component *c, const Call *call, size_t values, size_t variables);

/* Of model.c: for each column (t, q, v, u) of the derivatives of b and c of sensitivity.c the number of its group, of
 * which no two change the same part of them; NULL: each is one by itself. */
SHARED const int *const COLUMN_GROUPS;

static inline const unsigned *list_at(unsigned number) {
    const unsigned *list = LISTS;
    while (--number > 0) list += 1 + *list;
    return list;
}

#endif

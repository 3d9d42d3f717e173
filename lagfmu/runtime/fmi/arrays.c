/* arrays.c -- getting values where there are arrays (--arrays): of each all that is in it, in its place. */
#include "dependencies.h"

/* What is in an array, behind how much that is; NULL of a scalar. */
static const unsigned *array_at(unsigned reference) {
    const unsigned k = reference - (unsigned)VARIABLE_COUNT;
    return reference >= (unsigned)VARIABLE_COUNT && k < (unsigned)ARRAY_COUNT ? list_at(ARRAY_LISTS[k]) : NULL;
}

int get_arrays(Component *c, const Call *call, const Group *group, const unsigned references[], size_t count,
               double values[], size_t value_count) {
    size_t expected = 0, at = 0;
    int status = CALL_OK;
    for (size_t k = 0; k < count; k++) {
        const unsigned *array = array_at(references[k]);
        expected += array == NULL ? 1 : *array;
    }
    if (component_forbids(c, call) || component3_miscounts(c, call, value_count, expected)) return CALL_ERROR;
    for (size_t k = 0; k < count && status == CALL_OK; k++) {
        const unsigned *array = array_at(references[k]);
        const unsigned *held = array == NULL ? &references[k] : array + 1;
        const size_t size = array == NULL ? 1 : *array;
        status = component_get(c, call, group, held, size, values + at);
        at += size;
    }
    return status;
}

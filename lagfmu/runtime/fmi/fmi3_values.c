/* fmi3_values.c -- getting and setting variables. */
#include "dependencies.h"
#include "fmi3_component.h"

SHARED_VALUE const Group FLOAT64 = {"Float64", 1u << TYPE_REAL, AS_DOUBLE};
SHARED_VALUE const Group CLOCK = {"Clock", 1u << TYPE_CLOCK, AS_BOOL};
static const Group INT32 = {"Int32", 1u << TYPE_INTEGER, AS_INT};
static const Group INT64 = {"Int64 or Enumeration", 1u << TYPE_ENUMERATION, AS_LONG};
static const Group BOOL = {"Boolean", 1u << TYPE_BOOLEAN, AS_BOOL};

int component3_miscounts(Component *c, const Call *call, size_t values, size_t variables) {
    Why text;
    if (values == variables) return 0;
    (void)fail(&text, "%s: %lu values for %lu scalar variables", call->name, (unsigned long)values,
               (unsigned long)variables);
    (void)component_refuse(c, text.text);
    return 1;
}

static fmi3Status get(Component *c, const Call *call, const Group *group, const fmi3ValueReference references[],
                      size_t count, void *values, size_t value_count) {
    if (component_forbids(c, call) || component3_miscounts(c, call, value_count, count)) return fmi3Error;
    return component_get(c, call, group, references, count, values);
}

static fmi3Status set(Component *c, const Call *call, const Group *group, const fmi3ValueReference references[],
                      size_t count, const void *values, size_t value_count) {
    if (component_forbids(c, call) || component3_miscounts(c, call, value_count, count)) return fmi3Error;
    return component_set(c, call, group, references, count, values);
}

/* The functions of one type: fmi3GetTYPE, fmi3SetTYPE. */
#define FMI3_ACCESS(Type, group)                                                                                      \
    FMI3(fmi3Status, fmi3Get##Type)(fmi3Instance instance, const fmi3ValueReference valueReferences[],                \
                                    size_t nValueReferences, fmi3##Type values[], size_t nValues) {                   \
        return get(instance, FMI3_CALL(fmi3Get##Type), group, valueReferences, nValueReferences, values, nValues);    \
    }                                                                                                                 \
    FMI3(fmi3Status, fmi3Set##Type)(fmi3Instance instance, const fmi3ValueReference valueReferences[],                \
                                    size_t nValueReferences, const fmi3##Type values[], size_t nValues) {             \
        return set(instance, FMI3_CALL(fmi3Set##Type), group, valueReferences, nValueReferences, values, nValues);    \
    }

FMI3(fmi3Status, fmi3GetFloat64)(fmi3Instance instance, const fmi3ValueReference valueReferences[],
                                 size_t nValueReferences, fmi3Float64 values[], size_t nValues) {
    const Call *call = FMI3_CALL(fmi3GetFloat64);
    if (ARRAYS == NULL || nValueReferences == 0 || valueReferences == NULL || values == NULL)
        return get(instance, call, &FLOAT64, valueReferences, nValueReferences, values, nValues);
    return ARRAYS(instance, call, &FLOAT64, valueReferences, nValueReferences, values, nValues);
}

FMI3(fmi3Status, fmi3SetFloat64)(fmi3Instance instance, const fmi3ValueReference valueReferences[],
                                 size_t nValueReferences, const fmi3Float64 values[], size_t nValues) {
    return set(instance, FMI3_CALL(fmi3SetFloat64), &FLOAT64, valueReferences, nValueReferences, values, nValues);
}

FMI3_ACCESS(Int32, &INT32)
FMI3_ACCESS(Int64, &INT64)
FMI3_ACCESS(Boolean, &BOOL)

/* Of the other types there are no variables. */
#define FMI3_NO_ACCESS(Type) FMI3_ACCESS(Type, (&(const Group){#Type, 0, AS_DOUBLE}))
FMI3_NO_ACCESS(Float32)
FMI3_NO_ACCESS(Int8)
FMI3_NO_ACCESS(UInt8)
FMI3_NO_ACCESS(Int16)
FMI3_NO_ACCESS(UInt16)
FMI3_NO_ACCESS(UInt32)
FMI3_NO_ACCESS(UInt64)
FMI3_NO_ACCESS(String)

static const Group BINARY = {"Binary", 0, AS_DOUBLE};

FMI3(fmi3Status, fmi3GetBinary)(fmi3Instance instance, const fmi3ValueReference valueReferences[],
                                size_t nValueReferences, size_t valueSizes[], fmi3Binary values[], size_t nValues) {
    (void)valueSizes;
    return get(instance, FMI3_CALL(fmi3GetBinary), &BINARY, valueReferences, nValueReferences, values, nValues);
}

FMI3(fmi3Status, fmi3SetBinary)(fmi3Instance instance, const fmi3ValueReference valueReferences[],
                                size_t nValueReferences, const size_t valueSizes[], const fmi3Binary values[],
                                size_t nValues) {
    (void)valueSizes;
    return set(instance, FMI3_CALL(fmi3SetBinary), &BINARY, valueReferences, nValueReferences, values, nValues);
}

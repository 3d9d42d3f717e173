/* fmi3_derivatives.c -- partial derivatives and what variables depend on (section 2.2), derivatives with respect to
 * time (4.1). */
#include "dependencies.h"
#include "fmi3_component.h"

fmi3Status fmi3GetDirectionalDerivative(fmi3Instance instance, const fmi3ValueReference unknowns[],
                                        size_t nUnknowns, const fmi3ValueReference knowns[], size_t nKnowns,
                                        const fmi3Float64 seed[], size_t nSeed, fmi3Float64 sensitivity[],
                                        size_t nSensitivity) {
    const Call *call = FMI3_CALL(fmi3GetDirectionalDerivative);
    if (component_forbids(instance, call) || component3_miscounts(instance, call, nSeed, nKnowns) ||
        component3_miscounts(instance, call, nSensitivity, nUnknowns))
        return fmi3Error;
    return component_directional(instance, call, &FLOAT64, unknowns, nUnknowns, knowns, nKnowns, seed, sensitivity);
}

fmi3Status fmi3GetOutputDerivatives(fmi3Instance instance, const fmi3ValueReference valueReferences[],
                                    size_t nValueReferences, const fmi3Int32 orders[], fmi3Float64 values[],
                                    size_t nValues) {
    const Call *call = FMI3_CALL(fmi3GetOutputDerivatives);
    if (component_forbids(instance, call) || component3_miscounts(instance, call, nValues, nValueReferences))
        return fmi3Error;
    return component_rates(instance, call, &FLOAT64, valueReferences, nValueReferences, orders, values);
}

/* ------------------------------------------------------------------ dependencies */

/* NULL: nothing is said of the variable, and the log has it. */
static const Unknown *find_unknown(Component *c, const Call *call, fmi3ValueReference reference) {
    const Unknowns *all = c->instance.running ? &RUNNING_UNKNOWNS : &INITIAL_UNKNOWNS;
    Why text;
    for (int k = 0; k < all->count; k++)
        if (all->rows[k].reference == reference) return &all->rows[k];
    if (!DEPENDENCIES_TOLD)
        (void)fail(&text, "%s: this FMU is too large to say what its variables depend on, as modelDescription.xml "
                   "does not: take each to depend on all states and inputs", call->name);
    else if (reference < (unsigned)VARIABLE_COUNT)
        (void)fail(&text, "%s: '%s' is none of the unknowns of the model structure here", call->name,
                   VARIABLES[reference].name);
    else
        (void)fail(&text, "%s: value reference %u is no variable of this FMU", call->name, (unsigned)reference);
    (void)component_refuse(c, text.text);
    return NULL;
}

fmi3Status fmi3GetNumberOfVariableDependencies(fmi3Instance instance, fmi3ValueReference valueReference,
                                               size_t *nDependencies) {
    const Call *call = FMI3_CALL(fmi3GetNumberOfVariableDependencies);
    if (component_forbids(instance, call)) return fmi3Error;
    if (nDependencies == NULL) return component_missing(instance, call);
    const Unknown *unknown = find_unknown(instance, call, valueReference);
    if (unknown == NULL) return fmi3Error;
    *nDependencies = (size_t)unknown->count;
    return fmi3OK;
}

fmi3Status fmi3GetVariableDependencies(fmi3Instance instance, fmi3ValueReference dependent,
                                       size_t elementIndicesOfDependent[], fmi3ValueReference independents[],
                                       size_t elementIndicesOfIndependents[], fmi3DependencyKind dependencyKinds[],
                                       size_t nDependencies) {
    const Call *call = FMI3_CALL(fmi3GetVariableDependencies);
    Why text;
    if (component_forbids(instance, call)) return fmi3Error;
    const Unknown *unknown = find_unknown(instance, call, dependent);
    if (unknown == NULL) return fmi3Error;
    if (nDependencies != (size_t)unknown->count) {
        (void)fail(&text, "%s: room for %lu dependencies, value reference %u has %d", call->name,
                   (unsigned long)nDependencies, (unsigned)dependent, unknown->count);
        return component_refuse(instance, text.text);
    }
    if (nDependencies > 0 && (elementIndicesOfDependent == NULL || independents == NULL ||
                              elementIndicesOfIndependents == NULL || dependencyKinds == NULL))
        return component_missing(instance, call);
    for (size_t k = 0; k < nDependencies; k++) {
        const fmi3ValueReference on = KNOWNS[unknown->first + (int)k];
        elementIndicesOfDependent[k] = elementIndicesOfIndependents[k] = 0; /* all elements */
        independents[k] = on;
        dependencyKinds[k] = on == dependent ? fmi3Constant : fmi3Dependent; /* a state is itself */
    }
    return fmi3OK;
}

/* fmi3_derivatives.c -- partial derivatives and what variables depend on (section 2.2), derivatives with respect to
 * time (4.1). */
#include "dependencies.h"
#include "fmi3_component.h"

FMI3(fmi3Status, fmi3GetDirectionalDerivative)(fmi3Instance instance, const fmi3ValueReference unknowns[],
                                               size_t nUnknowns, const fmi3ValueReference knowns[], size_t nKnowns,
                                               const fmi3Float64 seed[], size_t nSeed, fmi3Float64 sensitivity[],
                                               size_t nSensitivity) {
    const Call *call = FMI3_CALL(fmi3GetDirectionalDerivative);
    if (component_forbids(instance, call) || component3_miscounts(instance, call, nSeed, nKnowns) ||
        component3_miscounts(instance, call, nSensitivity, nUnknowns))
        return fmi3Error;
    return component_directional(instance, call, &FLOAT64, unknowns, nUnknowns, knowns, nKnowns, seed, sensitivity);
}

FMI3(fmi3Status, fmi3GetOutputDerivatives)(fmi3Instance instance, const fmi3ValueReference valueReferences[],
                                           size_t nValueReferences, const fmi3Int32 orders[], fmi3Float64 values[],
                                           size_t nValues) {
    const Call *call = FMI3_CALL(fmi3GetOutputDerivatives);
    if (component_forbids(instance, call) || component3_miscounts(instance, call, nValues, nValueReferences))
        return fmi3Error;
    return component_rates(instance, call, &FLOAT64, valueReferences, nValueReferences, orders, values);
}

/* ------------------------------------------------------------------ dependencies */

/* What a variable depends on, behind how many these are; NULL: nothing is said of it, and the log has it. */
static const unsigned *find_list(Component *c, const Call *call, fmi3ValueReference reference) {
    const unsigned *lists = c->instance.running ? RUNNING_LISTS : INITIAL_LISTS;
    const int known = reference < (unsigned)VARIABLE_COUNT;
    Why text;
    if (DEPENDENCIES_TOLD && known && lists[reference] > 0 && !c->instance.dae) return list_at(lists[reference]);
    if (c->instance.dae)
        (void)fail(&text, "%s: in DAE mode the manifest of FMI-LS-DAE says what a variable depends on", call->name);
    else if (!DEPENDENCIES_TOLD)
        (void)fail(&text, "%s: this FMU is too large to say what its variables depend on, as modelDescription.xml "
                   "does not: take each to depend on all states and inputs", call->name);
    else if (known)
        (void)fail(&text, "%s: '%s' is none of the unknowns of the model structure here", call->name,
                   VARIABLES[reference].name);
    else
        (void)fail(&text, "%s: value reference %u is no variable of this FMU", call->name, (unsigned)reference);
    (void)component_refuse(c, text.text);
    return NULL;
}

FMI3(fmi3Status, fmi3GetNumberOfVariableDependencies)(fmi3Instance instance, fmi3ValueReference valueReference,
                                                      size_t *nDependencies) {
    const Call *call = FMI3_CALL(fmi3GetNumberOfVariableDependencies);
    if (component_forbids(instance, call)) return fmi3Error;
    if (nDependencies == NULL) return component_missing(instance, call);
    const unsigned *list = find_list(instance, call, valueReference);
    if (list == NULL) return fmi3Error;
    *nDependencies = *list;
    return fmi3OK;
}

FMI3(fmi3Status, fmi3GetVariableDependencies)(fmi3Instance instance, fmi3ValueReference dependent,
                                              size_t elementIndicesOfDependent[], fmi3ValueReference independents[],
                                              size_t elementIndicesOfIndependents[],
                                              fmi3DependencyKind dependencyKinds[], size_t nDependencies) {
    const Call *call = FMI3_CALL(fmi3GetVariableDependencies);
    Why text;
    if (component_forbids(instance, call)) return fmi3Error;
    const unsigned *list = find_list(instance, call, dependent);
    if (list == NULL) return fmi3Error;
    if (nDependencies != *list) {
        (void)fail(&text, "%s: room for %lu dependencies, value reference %u has %u", call->name,
                   (unsigned long)nDependencies, (unsigned)dependent, *list);
        return component_refuse(instance, text.text);
    }
    if (nDependencies > 0 && (elementIndicesOfDependent == NULL || independents == NULL ||
                              elementIndicesOfIndependents == NULL || dependencyKinds == NULL))
        return component_missing(instance, call);
    for (size_t k = 0; k < nDependencies; k++) {
        const fmi3ValueReference on = list[1 + k];
        elementIndicesOfDependent[k] = elementIndicesOfIndependents[k] = 0; /* all elements */
        independents[k] = on;
        dependencyKinds[k] = on == dependent ? fmi3Constant : fmi3Dependent; /* a state is itself */
    }
    return fmi3OK;
}

/* fmi3_exchange.c -- Model Exchange (section 3.2). */
#include "algebraic.h"
#include "exchange.h"
#include "fmi3_component.h"
#include "indicators.h"

FMI3(fmi3Status, fmi3EnterContinuousTimeMode)(fmi3Instance instance) {
    const Call *call = FMI3_CALL(fmi3EnterContinuousTimeMode);
    Component *c = instance;
    if (component_forbids(c, call)) return fmi3Error;
    if (ALGEBRAIC != NULL && ALGEBRAIC->renew(&c->instance) != OK) return component_failed(c, fmi3Error);
    if (component_turn(c, call, CONTINUOUS) != CALL_OK) return fmi3Error;
    return ALGEBRAIC == NULL || ALGEBRAIC->give(&c->instance) == OK ? fmi3OK : component_failed(c, fmi3Error);
}

FMI3(fmi3Status, fmi3CompletedIntegratorStep)(fmi3Instance instance, fmi3Boolean noSetFMUStatePriorToCurrentPoint,
                                              fmi3Boolean *enterEventMode, fmi3Boolean *terminateSimulation) {
    const Call *call = FMI3_CALL(fmi3CompletedIntegratorStep);
    Component *c = instance;
    int event = 0;
    (void)noSetFMUStatePriorToCurrentPoint; /* nothing is kept for it */
    if (component_forbids(c, call)) return fmi3Error;
    if (enterEventMode == NULL || terminateSimulation == NULL) return component_missing(c, call);
    if (exchange_step_done(&c->instance, &event) != OK) return component_failed(c, fmi3Error);
    *enterEventMode = event;
    *terminateSimulation = fmi3False;
    return fmi3OK;
}

FMI3(fmi3Status, fmi3SetTime)(fmi3Instance instance, fmi3Float64 time) {
    return component_set_time(instance, FMI3_CALL(fmi3SetTime), time);
}

FMI3(fmi3Status, fmi3SetContinuousStates)(fmi3Instance instance, const fmi3Float64 continuousStates[],
                                          size_t nContinuousStates) {
    return component_set_states(instance, FMI3_CALL(fmi3SetContinuousStates), continuousStates, nContinuousStates);
}

FMI3(fmi3Status, fmi3GetContinuousStateDerivatives)(fmi3Instance instance, fmi3Float64 derivatives[],
                                                    size_t nContinuousStates) {
    return component_read(instance, FMI3_CALL(fmi3GetContinuousStateDerivatives), exchange_derivatives, derivatives,
                          nContinuousStates, component_state_count());
}

FMI3(fmi3Status, fmi3GetEventIndicators)(fmi3Instance instance, fmi3Float64 eventIndicators[],
                                         size_t nEventIndicators) {
    return component_read(instance, FMI3_CALL(fmi3GetEventIndicators), exchange_indicators, eventIndicators,
                          nEventIndicators, indicators_count(MODEL_SYSTEM));
}

FMI3(fmi3Status, fmi3GetContinuousStates)(fmi3Instance instance, fmi3Float64 continuousStates[],
                                          size_t nContinuousStates) {
    return component_read(instance, FMI3_CALL(fmi3GetContinuousStates), exchange_get_states, continuousStates,
                          nContinuousStates, component_state_count());
}

FMI3(fmi3Status, fmi3GetNominalsOfContinuousStates)(fmi3Instance instance, fmi3Float64 nominals[],
                                                    size_t nContinuousStates) {
    return component_read(instance, FMI3_CALL(fmi3GetNominalsOfContinuousStates), exchange_nominals, nominals,
                          nContinuousStates, component_state_count());
}

static fmi3Status tell_number(Component *c, const Call *call, int number, size_t *told) {
    if (component_forbids(c, call)) return fmi3Error;
    if (told == NULL) return component_missing(c, call);
    *told = (size_t)number;
    return fmi3OK;
}

FMI3(fmi3Status, fmi3GetNumberOfEventIndicators)(fmi3Instance instance, size_t *nEventIndicators) {
    return tell_number(instance, FMI3_CALL(fmi3GetNumberOfEventIndicators), indicators_count(MODEL_SYSTEM),
                nEventIndicators);
}

FMI3(fmi3Status, fmi3GetNumberOfContinuousStates)(fmi3Instance instance, size_t *nContinuousStates) {
    return tell_number(instance, FMI3_CALL(fmi3GetNumberOfContinuousStates), component_state_count(), nContinuousStates);
}

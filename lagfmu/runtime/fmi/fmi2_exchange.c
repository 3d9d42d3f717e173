/* fmi2_exchange.c -- Model Exchange (section 3.2). */
#include <string.h>

#include "component.h"
#include "exchange.h"
#include "fmi2.h"
#include "fmi2_calls.h"
#include "indicators.h"

fmi2Status fmi2EnterEventMode(fmi2Component component) {
    return component_enter_event(component, FMI2_CALL(fmi2EnterEventMode));
}

fmi2Status fmi2NewDiscreteStates(fmi2Component component, fmi2EventInfo *eventInfo) {
    const Call *call = FMI2_CALL(fmi2NewDiscreteStates);
    Component *c = component;
    int moved = 0;
    if (eventInfo != NULL) memset(eventInfo, 0, sizeof *eventInfo); /* importers look at it after an error too */
    if (component_forbids(c, call)) return fmi2Error;
    if (eventInfo == NULL) return component_missing(c, call);
    if (exchange_event(&c->instance, &moved) != OK) return component_failed(c, fmi2Error);
    eventInfo->valuesOfContinuousStatesChanged = moved ? fmi2True : fmi2False;
    eventInfo->nominalsOfContinuousStatesChanged = exchange_nominals_news(&c->instance) ? fmi2True : fmi2False;
    return fmi2OK;
}

fmi2Status fmi2EnterContinuousTimeMode(fmi2Component component) {
    return component_turn(component, FMI2_CALL(fmi2EnterContinuousTimeMode), CONTINUOUS);
}

fmi2Status fmi2CompletedIntegratorStep(fmi2Component component,
                                       fmi2Boolean noSetFMUStatePriorToCurrentPoint,
                                       fmi2Boolean *enterEventMode,
                                       fmi2Boolean *terminateSimulation) {
    const Call *call = FMI2_CALL(fmi2CompletedIntegratorStep);
    Component *c = component;
    int event = 0;
    (void)noSetFMUStatePriorToCurrentPoint;
    if (enterEventMode != NULL) *enterEventMode = fmi2False;
    if (terminateSimulation != NULL) *terminateSimulation = fmi2False;
    if (component_forbids(c, call)) return fmi2Error;
    if (enterEventMode == NULL || terminateSimulation == NULL) return component_missing(c, call);
    if (exchange_step_done(&c->instance, &event) != OK) return component_failed(c, fmi2Error);
    *enterEventMode = event ? fmi2True : fmi2False;
    return fmi2OK;
}

fmi2Status fmi2SetTime(fmi2Component component, fmi2Real time) {
    return component_set_time(component, FMI2_CALL(fmi2SetTime), time);
}

fmi2Status fmi2SetContinuousStates(fmi2Component component, const fmi2Real x[], size_t nx) {
    return component_set_states(component, FMI2_CALL(fmi2SetContinuousStates), x, nx);
}

fmi2Status fmi2GetDerivatives(fmi2Component component, fmi2Real derivatives[], size_t nx) {
    return component_read(component, FMI2_CALL(fmi2GetDerivatives), exchange_derivatives, derivatives, nx,
                          component_state_count());
}

fmi2Status fmi2GetEventIndicators(fmi2Component component, fmi2Real eventIndicators[],
                                  size_t ni) {
    return component_read(component, FMI2_CALL(fmi2GetEventIndicators), exchange_indicators, eventIndicators, ni,
                          indicators_count(MODEL_SYSTEM));
}

fmi2Status fmi2GetContinuousStates(fmi2Component component, fmi2Real x[], size_t nx) {
    return component_read(component, FMI2_CALL(fmi2GetContinuousStates), exchange_get_states, x, nx,
                          component_state_count());
}

fmi2Status fmi2GetNominalsOfContinuousStates(fmi2Component component, fmi2Real x_nominal[],
                                             size_t nx) {
    return component_read(component, FMI2_CALL(fmi2GetNominalsOfContinuousStates), exchange_nominals, x_nominal, nx,
                          component_state_count());
}

/* fmi2_exchange.c -- Model Exchange (section 3.2). */
#include "fmi2_component.h"

#include <math.h>
#include <string.h>

#include "digits.h"
#include "exchange.h"
#include "indicators.h"

static fmi2Status wrong_size(Component *c, const char *function, size_t given, int expected) {
    Why text;
    (void)fail(&text, "%s: %lu values were given, this FMU has %d", function,
               (unsigned long)given, expected);
    return component_refuse(c, text.text);
}

fmi2Status fmi2EnterEventMode(fmi2Component component) {
    Component *c = component;
    if (!component_allowed(c, EXCHANGE)) return component_forbidden(c, "fmi2EnterEventMode");
    if (exchange_enter_event(&c->instance) != OK) return component_failed(c, fmi2Error);
    c->instance.phase = EVENT;
    return fmi2OK;
}

fmi2Status fmi2NewDiscreteStates(fmi2Component component, fmi2EventInfo *eventInfo) {
    Component *c = component;
    int moved = 0;
    if (eventInfo != NULL) memset(eventInfo, 0, sizeof *eventInfo); /* importers look at it after an error too */
    if (!component_allowed(c, EVENT)) return component_forbidden(c, "fmi2NewDiscreteStates");
    if (eventInfo == NULL) return component_missing(c, "fmi2NewDiscreteStates");
    if (exchange_event(&c->instance, &moved) != OK) return component_failed(c, fmi2Error);
    eventInfo->valuesOfContinuousStatesChanged = moved ? fmi2True : fmi2False;
    return fmi2OK;
}

fmi2Status fmi2EnterContinuousTimeMode(fmi2Component component) {
    Component *c = component;
    if (!component_allowed(c, EVENT)) return component_forbidden(c, "fmi2EnterContinuousTimeMode");
    c->instance.phase = CONTINUOUS;
    return fmi2OK;
}

fmi2Status fmi2CompletedIntegratorStep(fmi2Component component,
                                       fmi2Boolean noSetFMUStatePriorToCurrentPoint,
                                       fmi2Boolean *enterEventMode,
                                       fmi2Boolean *terminateSimulation) {
    Component *c = component;
    int event = 0;
    (void)noSetFMUStatePriorToCurrentPoint;
    if (enterEventMode != NULL) *enterEventMode = fmi2False;
    if (terminateSimulation != NULL) *terminateSimulation = fmi2False;
    if (!component_allowed(c, CONTINUOUS)) return component_forbidden(c, "fmi2CompletedIntegratorStep");
    if (enterEventMode == NULL || terminateSimulation == NULL)
        return component_missing(c, "fmi2CompletedIntegratorStep");
    if (exchange_step_done(&c->instance, &event) != OK) return component_failed(c, fmi2Error);
    *enterEventMode = event ? fmi2True : fmi2False;
    return fmi2OK;
}

fmi2Status fmi2SetTime(fmi2Component component, fmi2Real time) {
    Component *c = component;
    Why text;
    if (!component_allowed(c, EXCHANGE)) return component_forbidden(c, "fmi2SetTime");
    if (!isfinite(time)) {
        (void)fail(&text, "fmi2SetTime: %s s, expected a finite time", digits(time).text);
        return component_refuse(c, text.text);
    }
    exchange_set_time(&c->instance, time);
    return fmi2OK;
}

static int state_count(void) { return system_states(MODEL_SYSTEM) + EXCHANGE_LOST; }

fmi2Status fmi2SetContinuousStates(fmi2Component component, const fmi2Real x[], size_t nx) {
    Component *c = component;
    Why text;
    if (!component_allowed(c, CONTINUOUS)) return component_forbidden(c, "fmi2SetContinuousStates");
    if (nx != (size_t)state_count())
        return wrong_size(c, "fmi2SetContinuousStates", nx, state_count());
    if (x == NULL) return component_missing(c, "fmi2SetContinuousStates");
    for (size_t k = 0; k < nx; k++)
        if (!isfinite(x[k])) {
            (void)fail(&text, "fmi2SetContinuousStates: state %lu is %s, expected a finite number",
                       (unsigned long)k + 1, digits(x[k]).text);
            component_message(c, fmi2Discard, LOG_DISCARDS, text.text);
            return fmi2Discard;
        }
    return exchange_set_states(&c->instance, x) == OK ? fmi2OK : component_failed(c, fmi2Discard);
}

/* Reads an array of Model Exchange. */
static fmi2Status read_array(Component *c, const char *function, int modes,
                             Status (*read)(Instance *, double *), double *values, size_t given,
                             int expected) {
    if (!component_allowed(c, modes) || !c->instance.exchange) return component_forbidden(c, function);
    if (given != (size_t)expected) return wrong_size(c, function, given, expected);
    if (given > 0 && values == NULL) return component_missing(c, function);
    if (read(&c->instance, values) != OK) return component_no_value(c);
    for (int k = 0; k < expected; k++) {
        if (isfinite(values[k])) continue;
        (void)fail(&c->instance.solver.why, "%s: value %d is not finite", function, k + 1);
        return component_no_value(c);
    }
    return fmi2OK;
}

fmi2Status fmi2GetDerivatives(fmi2Component component, fmi2Real derivatives[], size_t nx) {
    return read_array(component, "fmi2GetDerivatives", READABLE, exchange_derivatives, derivatives,
                      nx, state_count());
}

fmi2Status fmi2GetEventIndicators(fmi2Component component, fmi2Real eventIndicators[],
                                  size_t ni) {
    return read_array(component, "fmi2GetEventIndicators", READABLE, exchange_indicators,
                      eventIndicators, ni, indicators_count(MODEL_SYSTEM));
}

fmi2Status fmi2GetContinuousStates(fmi2Component component, fmi2Real x[], size_t nx) {
    return read_array(component, "fmi2GetContinuousStates", READABLE, exchange_get_states, x, nx,
                      state_count());
}

fmi2Status fmi2GetNominalsOfContinuousStates(fmi2Component component, fmi2Real x_nominal[],
                                             size_t nx) {
    return read_array(component, "fmi2GetNominalsOfContinuousStates", ANY_MODE, exchange_nominals,
                      x_nominal, nx, state_count());
}

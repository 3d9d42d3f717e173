/* fmi3_steps.c -- co-simulation: communication steps (section 4.2), events of both interface types (2.3); many runs in
 * one call. */
#include "exchange.h"
#include "fmi3_component.h"

/* ------------------------------------------------------------------ Event Mode */

FMI3(fmi3Status, fmi3EnterEventMode)(fmi3Instance instance) {
    return component_enter_event(instance, FMI3_CALL(fmi3EnterEventMode));
}

/* They are evaluated as soon as they are asked for. */
FMI3(fmi3Status, fmi3EvaluateDiscreteStates)(fmi3Instance instance) {
    return component_turn(instance, FMI3_CALL(fmi3EvaluateDiscreteStates), EVENT);
}

FMI3(fmi3Status, fmi3UpdateDiscreteStates)(fmi3Instance instance, fmi3Boolean *discreteStatesNeedUpdate,
                                           fmi3Boolean *terminateSimulation,
                                           fmi3Boolean *nominalsOfContinuousStatesChanged,
                                           fmi3Boolean *valuesOfContinuousStatesChanged,
                                           fmi3Boolean *nextEventTimeDefined, fmi3Float64 *nextEventTime) {
    const Call *call = FMI3_CALL(fmi3UpdateDiscreteStates);
    Component *c = instance;
    int moved = 0, again = 0;
    if (component_forbids(c, call)) return fmi3Error;
    if (discreteStatesNeedUpdate == NULL || terminateSimulation == NULL ||
        nominalsOfContinuousStatesChanged == NULL || valuesOfContinuousStatesChanged == NULL ||
        nextEventTimeDefined == NULL || nextEventTime == NULL)
        return component_missing(c, call);
    if (component_update(c, &moved, &again) != CALL_OK) return fmi3Error;
    *discreteStatesNeedUpdate = again;
    *terminateSimulation = *nextEventTimeDefined = fmi3False;
    *nominalsOfContinuousStatesChanged = exchange_nominals_news(&c->instance);
    *valuesOfContinuousStatesChanged = moved;
    *nextEventTime = 0;
    return fmi3OK;
}

/* ------------------------------------------------------------------ Step Mode */

FMI3(fmi3Status, fmi3EnterStepMode)(fmi3Instance instance) {
    return component_turn(instance, FMI3_CALL(fmi3EnterStepMode), STEP_COMPLETE);
}

FMI3(fmi3Status, fmi3DoStep)(fmi3Instance instance, fmi3Float64 currentCommunicationPoint,
                             fmi3Float64 communicationStepSize, fmi3Boolean noSetFMUStatePriorToCurrentPoint,
                             fmi3Boolean *eventHandlingNeeded, fmi3Boolean *terminateSimulation,
                             fmi3Boolean *earlyReturn, fmi3Float64 *lastSuccessfulTime) {
    const Call *call = FMI3_CALL(fmi3DoStep);
    Component *c = instance;
    const double t = currentCommunicationPoint, h = communicationStepSize;
    (void)noSetFMUStatePriorToCurrentPoint; /* nothing is kept for it */
    if (component_forbids(c, call)) return fmi3Error;
    if (eventHandlingNeeded == NULL || terminateSimulation == NULL || earlyReturn == NULL ||
        lastSuccessfulTime == NULL)
        return component_missing(c, call);
    *eventHandlingNeeded = *terminateSimulation = *earlyReturn = fmi3False;
    *lastSuccessfulTime = c->instance.solver.state.now.t;
    if (instance_steppable(&c->instance, t, h) != OK) return component_refused(c, call);
    if (instance_step(&c->instance, t + h) != OK) {
        *terminateSimulation = fmi3True; /* an importer that is told to go on tries the same step again */
        return component_failed(c, fmi3Discard);
    }
    *lastSuccessfulTime = c->instance.solver.state.now.t;
    *eventHandlingNeeded = c->instance.solver.state.now.pending;
    *earlyReturn = *lastSuccessfulTime < t + h;
    return fmi3OK;
}

/* ------------------------------------------------------------------ beside the standard */

/* What became of the runs stands in the batch; the instance is as new. */
FMI3(fmi3Status, lagfmu_batch)(fmi3Instance instance, Batch *batch) {
    return component_runs(instance, FMI3_CALL(lagfmu_batch), batch);
}

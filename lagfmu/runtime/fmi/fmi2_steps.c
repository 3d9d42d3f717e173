/* fmi2_steps.c -- co-simulation: communication steps and their status (section 4.2); many runs in one call. */
#include "batch.h"
#include "fmi2_component.h"

fmi2Status fmi2DoStep(fmi2Component component, fmi2Real currentCommunicationPoint,
                      fmi2Real communicationStepSize,
                      fmi2Boolean noSetFMUStatePriorToCurrentPoint) {
    Component *c = component;
    const double t = currentCommunicationPoint, h = communicationStepSize;
    (void)noSetFMUStatePriorToCurrentPoint; /* nothing is kept for it */
    if (!component_allowed(c, STEPPING)) return component_forbidden(c, "fmi2DoStep");
    if (instance_steppable(&c->instance, t, h) != OK) return component_refused(c, "fmi2DoStep");
    if (instance_step(&c->instance, t + h) != OK) {
        c->instance.phase = STEP_FAILED;
        return component_failed(c, fmi2Discard);
    }
    c->instance.phase = STEP_COMPLETE;
    return fmi2OK;
}

fmi2Status fmi2CancelStep(fmi2Component component) {
    return component_forbidden(component, "fmi2CancelStep"); /* no step is ever in progress */
}

/* What only an asynchronous step has to say (section 4.2.3). */
static fmi2Status nothing_to_say(Component *c, const char *function, fmi2StatusKind kind) {
    static const char *const KINDS[] = {"fmi2DoStepStatus", "fmi2PendingStatus",
                                        "fmi2LastSuccessfulTime", "fmi2Terminated"};
    Why text;
    if (!component_steps(c, STEPPING | TERMINATED)) return component_forbidden(c, function);
    const int known = (unsigned)kind <= (unsigned)fmi2Terminated;
    (void)fail(&text, "%s has nothing to say about %s: steps are never pending here", function,
               known ? KINDS[kind] : "this kind of status");
    component_message(c, fmi2Discard, LOG_DISCARDS, text.text);
    return fmi2Discard;
}

fmi2Status fmi2GetStatus(fmi2Component component, const fmi2StatusKind s, fmi2Status *value) {
    (void)value;
    return nothing_to_say(component, "fmi2GetStatus", s);
}

fmi2Status fmi2GetRealStatus(fmi2Component component, const fmi2StatusKind s, fmi2Real *value) {
    Component *c = component;
    if (s != fmi2LastSuccessfulTime || !component_steps(c, STEPPING | TERMINATED))
        return nothing_to_say(c, "fmi2GetRealStatus", s);
    if (value == NULL) return component_missing(c, "fmi2GetRealStatus");
    *value = c->instance.solver.state.now.t;
    return fmi2OK;
}

fmi2Status fmi2GetIntegerStatus(fmi2Component component, const fmi2StatusKind s,
                                fmi2Integer *value) {
    (void)value;
    return nothing_to_say(component, "fmi2GetIntegerStatus", s);
}

fmi2Status fmi2GetBooleanStatus(fmi2Component component, const fmi2StatusKind s,
                                fmi2Boolean *value) {
    Component *c = component;
    if (s != fmi2Terminated || !component_steps(c, STEPPING | TERMINATED))
        return nothing_to_say(c, "fmi2GetBooleanStatus", s);
    if (value == NULL) return component_missing(c, "fmi2GetBooleanStatus");
    /* After a step that cannot be done the FMU asks for the end: an importer that is told to go on tries
     * the same step again, for ever.  One that can step otherwise is free to. */
    *value = c->instance.phase == STEP_FAILED;
    return fmi2OK;
}

fmi2Status fmi2GetStringStatus(fmi2Component component, const fmi2StatusKind s,
                               fmi2String *value) {
    (void)value;
    return nothing_to_say(component, "fmi2GetStringStatus", s);
}

/* ------------------------------------------------------------------ beside the standard */

#define lagfmu_runs FMI2_NAME(lagfmu_runs)

/* What became of the runs stands in the batch; the instance is as new. */
FMI2_EXPORT fmi2Status lagfmu_runs(fmi2Component component, Batch *batch);

fmi2Status lagfmu_runs(fmi2Component component, Batch *batch) {
    Component *c = component;
    if (!component_allowed(c, ANY_MODE) || c->instance.exchange)
        return component_forbidden(c, "lagfmu_runs");
    if (batch == NULL || batch->points < 2) return component_missing(c, "lagfmu_runs");
    char *states = c->callbacks.allocateMemory(2, instance_record_size(&c->instance));
    if (states == NULL) return component_refuse(c, "lagfmu_runs: no memory");
    batch_run(&c->instance, batch, states);
    c->callbacks.freeMemory(states);
    c->instance.phase = INSTANTIATED;
    return fmi2OK;
}

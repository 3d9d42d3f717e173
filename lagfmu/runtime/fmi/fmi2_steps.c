/* fmi2_steps.c -- co-simulation: communication steps and their status (section 4.2); many runs in one call. */
#include "batch.h"
#include "component.h"
#include "fmi2.h"
#include "fmi2_calls.h"

fmi2Status fmi2DoStep(fmi2Component component, fmi2Real currentCommunicationPoint,
                      fmi2Real communicationStepSize,
                      fmi2Boolean noSetFMUStatePriorToCurrentPoint) {
    const Call *call = FMI2_CALL(fmi2DoStep);
    Component *c = component;
    const double t = currentCommunicationPoint, h = communicationStepSize;
    (void)noSetFMUStatePriorToCurrentPoint; /* nothing is kept for it */
    if (component_forbids(c, call)) return fmi2Error;
    if (instance_steppable(&c->instance, t, h) != OK) return component_refused(c, call);
    if (instance_step(&c->instance, t + h) != OK) {
        c->instance.phase = STEP_FAILED;
        return component_failed(c, fmi2Discard);
    }
    c->instance.phase = STEP_COMPLETE;
    return fmi2OK;
}

fmi2Status fmi2CancelStep(fmi2Component component) {
    (void)component_forbids(component, FMI2_CALL(fmi2CancelStep));
    return fmi2Error;
}

/* What only an asynchronous step has to say (section 4.2.3). */
static fmi2Status nothing_to_say(Component *c, const Call *call, fmi2StatusKind kind) {
    static const char *const KINDS[] = {"fmi2DoStepStatus", "fmi2PendingStatus",
                                        "fmi2LastSuccessfulTime", "fmi2Terminated"};
    Why text;
    const int known = (unsigned)kind <= (unsigned)fmi2Terminated;
    (void)fail(&text, "%s has nothing to say about %s: steps are never pending here", call->name,
               known ? KINDS[kind] : "this kind of status");
    component_message(c, fmi2Discard, LOG_DISCARDS, text.text);
    return fmi2Discard;
}

fmi2Status fmi2GetStatus(fmi2Component component, const fmi2StatusKind s, fmi2Status *value) {
    const Call *call = FMI2_CALL(fmi2GetStatus);
    (void)value;
    return component_forbids(component, call) ? fmi2Error : nothing_to_say(component, call, s);
}

fmi2Status fmi2GetRealStatus(fmi2Component component, const fmi2StatusKind s, fmi2Real *value) {
    const Call *call = FMI2_CALL(fmi2GetRealStatus);
    Component *c = component;
    if (component_forbids(c, call)) return fmi2Error;
    if (s != fmi2LastSuccessfulTime) return nothing_to_say(c, call, s);
    if (value == NULL) return component_missing(c, call);
    *value = c->instance.solver.state.now.t;
    return fmi2OK;
}

fmi2Status fmi2GetIntegerStatus(fmi2Component component, const fmi2StatusKind s,
                                fmi2Integer *value) {
    const Call *call = FMI2_CALL(fmi2GetIntegerStatus);
    (void)value;
    return component_forbids(component, call) ? fmi2Error : nothing_to_say(component, call, s);
}

fmi2Status fmi2GetBooleanStatus(fmi2Component component, const fmi2StatusKind s,
                                fmi2Boolean *value) {
    const Call *call = FMI2_CALL(fmi2GetBooleanStatus);
    Component *c = component;
    if (component_forbids(c, call)) return fmi2Error;
    if (s != fmi2Terminated) return nothing_to_say(c, call, s);
    if (value == NULL) return component_missing(c, call);
    /* After a step that cannot be done the FMU asks for the end: an importer that is told to go on tries
     * the same step again, for ever.  One that can step otherwise is free to. */
    *value = c->instance.phase == STEP_FAILED;
    return fmi2OK;
}

fmi2Status fmi2GetStringStatus(fmi2Component component, const fmi2StatusKind s,
                               fmi2String *value) {
    const Call *call = FMI2_CALL(fmi2GetStringStatus);
    (void)value;
    return component_forbids(component, call) ? fmi2Error : nothing_to_say(component, call, s);
}

/* ------------------------------------------------------------------ beside the standard */

#define lagfmu_batch FMI2_NAME(lagfmu_batch)

/* What became of the runs stands in the batch; the instance is as new. */
FMI2_EXPORT fmi2Status lagfmu_batch(fmi2Component component, Batch *batch);

fmi2Status lagfmu_batch(fmi2Component component, Batch *batch) {
    return component_runs(component, FMI2_CALL(lagfmu_batch), batch);
}

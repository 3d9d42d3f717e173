/* fmi2_steps.c -- co-simulation: communication steps and their status (section 4.2). */
#include "fmi2_component.h"

#include <float.h>
#include <math.h>

#include "digits.h"

static const double ROUNDING = 1e-6; /* part of a step by which sums of times may differ from ours */

/* A step that cannot be: its size, its beginning or its end. */
static fmi2Status refuse_step(Component *c, double t, double h) {
    const double now = c->instance.solver.state.now.t;
    Why text;
    if (!(h > 0 && h <= DBL_MAX))
        (void)fail(&text, "fmi2DoStep: the communication step is %s s, expected a positive number",
                   digits(h).text);
    else if (!(fabs(t - now) <= ROUNDING * h + 1e-12 * fabs(now)))
        (void)fail(&text,
                   "fmi2DoStep: the communication point is %s s, but this FMU stands at %s s: "
                   "continue there, or restore a state saved at that time",
                   digits(t).text, digits(now).text);
    else
        (void)fail(&text,
                   "fmi2DoStep: the step ends at %s s, after the stop time %s s that "
                   "fmi2SetupExperiment defined",
                   digits(t + h).text, digits(c->instance.stop_time).text);
    return component_refuse(c, text.text);
}

fmi2Status fmi2DoStep(fmi2Component component, fmi2Real currentCommunicationPoint,
                      fmi2Real communicationStepSize,
                      fmi2Boolean noSetFMUStatePriorToCurrentPoint) {
    Component *c = component;
    const double t = currentCommunicationPoint, h = communicationStepSize;
    (void)noSetFMUStatePriorToCurrentPoint; /* nothing is kept for it */
    if (!component_allowed(c, STEPPING)) return component_forbidden(c, "fmi2DoStep");
    const double now = c->instance.solver.state.now.t;
    const double slack = ROUNDING * h + 1e-12 * fabs(now);
    if (!(h > 0 && h <= DBL_MAX && fabs(t - now) <= slack &&
          t + h <= c->instance.stop_time + slack))
        return refuse_step(c, t, h);
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

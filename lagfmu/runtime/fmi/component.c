/* component.c -- an importer's instance: its modes, what it says and what it refuses (component.h). */
#include "component.h"

#include <string.h>

#include "exchange.h"

SHARED_VALUE const char *const CATEGORIES[LOG_CATEGORIES] = {
    "logStatusWarning", "logStatusDiscard", "logStatusError",
    "logStatusFatal",   "logEvents",        "logAll"};

/* ------------------------------------------------------------------ log */

void component_message(Component *c, int status, int category, const char *text) {
    const int always = status >= CALL_DISCARD; /* what a call returns is never without a reason */
    if (always || c->logging & (1u << category | 1u << LOG_ALL)) c->send(c, status, category, text);
}

/* As instance.h calls it. */
static void told(void *context, Note note, const char *text) {
    switch (note) {
        case NOTE_WARNING: component_message(context, CALL_WARNING, LOG_WARNINGS, text); break;
        case NOTE_EVENT: component_message(context, CALL_OK, LOG_EVENTS, text); break;
        case NOTE_DISCARD: component_message(context, CALL_DISCARD, LOG_DISCARDS, text); break;
        case NOTE_ERROR: component_message(context, CALL_ERROR, LOG_ERRORS, text); break;
    }
}

static void listen(Component *c, unsigned categories) {
    c->logging = categories;
    c->instance.quiet = !(categories & (1u << LOG_EVENTS | 1u << LOG_ALL));
}

static int category_of(const char *name) {
    for (int k = 0; name != NULL && k < LOG_CATEGORIES; k++)
        if (strcmp(name, CATEGORIES[k]) == 0) return k;
    return -1;
}

int component_listen(Component *c, const Call *call, int on, size_t count, const char *const categories[]) {
    unsigned chosen = count == 0 ? ~0u : 0u;
    Why text;
    if (component_forbids(c, call)) return CALL_ERROR;
    if (count > 0 && categories == NULL) return component_missing(c, call);
    for (size_t k = 0; k < count; k++) {
        const int found = category_of(categories[k]);
        if (found < 0) {
            (void)fail(&text, "%s: no log category is called '%s'", call->name,
                       categories[k] == NULL ? "" : categories[k]);
            return component_refuse(c, text.text);
        }
        chosen |= 1u << found;
    }
    listen(c, on ? chosen : c->logging & ~(chosen | 1u << LOG_ALL)); /* only those */
    return CALL_OK;
}

/* ------------------------------------------------------------------ modes */

Status component_exchanges(const char *function, Why *why) {
    if (MODEL_SYSTEM->estimated_count > 0)
        return fail(why,
                    "%s: the rates of a prescribed motion are estimated from communication points, which Model "
                    "Exchange has not: take co-simulation",
                    function);
    if (ERROR_BARS != NULL)
        return fail(why,
                    "%s: error bars come from a finer run beside the FMU's own, and in Model Exchange the importer "
                    "integrates: take co-simulation, or an FMU without",
                    function);
    if (DERIVATIVES != NULL)
        return fail(why,
                    "%s: a run's derivatives are integrated beside its state, and in Model Exchange the importer "
                    "integrates: take co-simulation, or an FMU without",
                    function);
    return OK;
}

void component_begin(Component *c, int exchange, int logging) {
    listen(c, logging ? ~0u : 0u);
    c->instance.tell = told;
    c->instance.context = c;
    c->instance.exchange = exchange;
    component_reset(c);
}

void component_reset(Component *c) {
    instance_reset(&c->instance);
    c->instance.phase = INSTANTIATED;
}

int component_turn(Component *c, const Call *call, int phase) {
    if (component_forbids(c, call)) return CALL_ERROR;
    if (phase == CONTINUOUS) exchange_hold(&c->instance);
    c->instance.phase = phase;
    return CALL_OK;
}

int component_initialize(Component *c, const Call *call, int phase) {
    if (component_forbids(c, call)) return CALL_ERROR;
    if (instance_initialize(&c->instance) != OK) return component_failed(c, CALL_ERROR);
    c->instance.phase = phase;
    return CALL_OK;
}

static const char *mode_name(const Component *c) {
    switch (c->instance.phase) {
        case INSTANTIATED: return "instantiated";
        case CONFIGURATION: return "configuration mode";
        case INITIALIZATION: return "initialization mode";
        case STEP_COMPLETE: return "step complete";
        case STEP_FAILED: return "step failed";
        case EVENT: return "event mode";
        case CONTINUOUS: return "continuous-time mode";
        case BETWEEN: return "intermediate update mode";
        default: return "terminated";
    }
}

int component_forbids(Component *c, const Call *call) {
    if (c == NULL) return 1;
    if (c->instance.phase & (c->instance.exchange ? call->exchange : call->steps)) return 0;
    (void)component_forbidden(c, call);
    return 1;
}

int component_runs(Component *c, const Call *call, Batch *batch) {
    if (component_forbids(c, call)) return CALL_ERROR;
    if (batch == NULL || batch->points < 2) return component_missing(c, call);
    const Halt halt = c->instance.solver.halt;
    c->instance.solver.halt = HALT_NEVER;
    batch_run(&c->instance, batch);
    c->instance.solver.halt = halt;
    c->instance.phase = INSTANTIATED;
    return CALL_OK;
}

/* ------------------------------------------------------------------ refusals */

int component_refuse(Component *c, const char *text) {
    component_message(c, CALL_ERROR, LOG_ERRORS, text);
    return CALL_ERROR;
}

int component_refused(Component *c, const Call *call) {
    Why text;
    (void)fail(&text, "%s: %s", call->name, c->instance.solver.why.text);
    return component_refuse(c, text.text);
}

int component_failed(Component *c, int status) {
    component_message(c, status, status == CALL_DISCARD ? LOG_DISCARDS : LOG_ERRORS,
                      c->instance.solver.why.text);
    return status;
}

int component_forbidden(Component *c, const Call *call) {
    Why text;
    (void)fail(&text, "%s cannot be called in the state '%s' of a %s instance", call->name, mode_name(c),
               c->instance.exchange ? "Model Exchange" : "co-simulation");
    return component_refuse(c, text.text);
}

int component_out_of_turn(Component *c, const Call *call) {
    Why text;
    (void)fail(&text, "%s: %s", call->name,
               c->asked ? "within a step inputs are asked for, and nothing can be read now"
                        : "within a step no input is asked for now");
    return component_refuse(c, text.text);
}

int component_missing(Component *c, const Call *call) {
    Why text;
    (void)fail(&text, "%s: an array or pointer is NULL", call->name);
    return component_refuse(c, text.text);
}

int component_unknown(Component *c, const Call *call, unsigned reference, const Group *group) {
    Why text;
    (void)fail(&text, "%s: value reference %u is no %s variable of this FMU", call->name, reference, group->name);
    return component_refuse(c, text.text);
}

/* In Model Exchange the importer's integrator may try another state. */
int component_no_value(Component *c) {
    const int tries = c->instance.exchange && c->instance.phase & EXCHANGE;
    return component_failed(c, tries ? CALL_DISCARD : CALL_ERROR);
}

int component_no_derivative(Component *c, const Call *call, const Variable *v) {
    Why text;
    (void)fail(&text, "%s: the derivative of '%s' is not defined here", call->name, v->name);
    return component_refuse(c, text.text);
}

/* component_exchange.c -- Model Exchange: arrays of states, derivatives and indicators. */
#include <math.h>

#include "component.h"
#include "digits.h"
#include "exchange.h"

int component_state_count(void) { return system_states(MODEL_SYSTEM) + EXCHANGE_LOST; }

static int wrong_size(Component *c, const Call *call, size_t given, int expected) {
    Why text;
    (void)fail(&text, "%s: %lu values were given, this FMU has %d", call->name, (unsigned long)given, expected);
    return component_refuse(c, text.text);
}

static int has_clocks(void) {
    return VARIABLE_COUNT > 0 && VARIABLES[VARIABLE_COUNT - 1].type == TYPE_CLOCK; /* which stand last */
}

int component_enter_event(Component *c, const Call *call) {
    Instance *x = &c->instance;
    if (component_forbids(c, call)) return CALL_ERROR;
    if (!x->exchange && !c->meets) {
        Why text;
        (void)fail(&text, "%s: the instance was made without the event mode of co-simulation", call->name);
        return component_refuse(c, text.text);
    }
    if ((x->exchange ? exchange_enter_event(x) : instance_meet(x)) != OK) return component_failed(c, CALL_ERROR);
    c->instance.phase = EVENT;
    return CALL_OK;
}

int component_update(Component *c, int *moved, int *again) {
    Instance *x = &c->instance;
    *moved = *again = 0;
    if (!x->exchange) return instance_settle(x, again) == OK ? CALL_OK : component_failed(c, CALL_ERROR);
    instance_count_events(x);
    if (exchange_event(x, moved) != OK) return component_failed(c, CALL_ERROR);
    x->ticking = instance_event_happened(x);
    *again = x->ticking && has_clocks();
    return CALL_OK;
}

int component_set_time(Component *c, const Call *call, double time) {
    Why text;
    if (component_forbids(c, call)) return CALL_ERROR;
    if (!isfinite(time)) {
        (void)fail(&text, "%s: %s s, expected a finite time", call->name, digits(time).text);
        return component_refuse(c, text.text);
    }
    exchange_set_time(&c->instance, time);
    return CALL_OK;
}

int component_set_states(Component *c, const Call *call, const double states[], size_t given) {
    Why text;
    if (component_forbids(c, call)) return CALL_ERROR;
    if (given != (size_t)component_state_count()) return wrong_size(c, call, given, component_state_count());
    if (states == NULL) return component_missing(c, call);
    for (size_t k = 0; k < given; k++)
        if (!isfinite(states[k])) {
            (void)fail(&text, "%s: state %lu is %s, expected a finite number", call->name, (unsigned long)k + 1,
                       digits(states[k]).text);
            component_message(c, CALL_DISCARD, LOG_DISCARDS, text.text);
            return CALL_DISCARD;
        }
    return exchange_set_states(&c->instance, states) == OK ? CALL_OK : component_failed(c, CALL_DISCARD);
}

int component_read(Component *c, const Call *call, Status (*read)(Instance *, double *), double *values,
                   size_t given, int expected) {
    if (component_forbids(c, call)) return CALL_ERROR;
    if (given != (size_t)expected) return wrong_size(c, call, given, expected);
    if (given > 0 && values == NULL) return component_missing(c, call);
    if (read(&c->instance, values) != OK) return component_no_value(c);
    for (int k = 0; k < expected; k++) {
        if (isfinite(values[k])) continue;
        (void)fail(&c->instance.solver.why, "%s: value %d is not finite", call->name, k + 1);
        return component_no_value(c);
    }
    return CALL_OK;
}

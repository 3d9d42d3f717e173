/* fmi3_between.c -- Intermediate Update Mode (section 4.2): within a communication step the importer supplies inputs and
 * looks at outputs, those that it named, and may ask for an end.
 *
 * Inputs are asked for at each time at which the equations of motion are evaluated, so that the motion follows them as
 * closely as the tolerance says, whatever the communication step is. */
#include "fmi3_component.h"

/* Those that the description marks with intermediateUpdate: continuous ones. */
static int is_intermediate(const Variable *v) {
    const System *s = MODEL_SYSTEM;
    if (v->type != TYPE_REAL) return 0;
    if (v->role == ROLE_INPUT) {
        for (int i = 0; i < s->estimated_count; i++)
            if (v->index >= s->estimated[i] && v->index <= s->estimated[i] + 3) return 0;
        return ERROR_BARS == NULL; /* the finer run would have to be supplied once more */
    }
    if (v->role != ROLE_OUTPUT && v->role != ROLE_START) return 0;
    if (v->place == AT_LOST) return s->frictions > 0; /* impacts make it jump, and nothing else changes it */
    if (is_of_event(v->place) || (v->place >= AT_PEAK_MAX && v->place <= AT_PEAK_MIN_TIME)) return 0;
    return v->place != AT_IMPULSE && v->place != AT_ERROR && v->place != AT_TIME && v->place != AT_INDICATOR;
}

/* The importer's function is called: what of its answer counts is the time at which the step is to end [s]. */
static double update(Component3 *made, double t, double end, int supplies) {
    Component *c = &made->common;
    const int phase = c->instance.phase, can_return = !supplies && made->early && t < end;
    bool requested = false;
    double time = end;
    c->instance.phase = BETWEEN;
    c->asked = supplies;
    made->update(made->environment, t, supplies, !supplies, !supplies, can_return, &requested, &time);
    c->instance.phase = phase;
    return requested && can_return ? time : end;
}

static double look_between(void *context, double t, double end) { return update(context, t, end, 0); }

static void ask_between(void *context, double t) { (void)update(context, t, t, 1); }

Status component3_name(Component3 *made, const char *function, const fmi3ValueReference references[], size_t count,
                       Why *why) {
    Between *between = &made->common.instance.between;
    char *named = made->common.named;
    if (count > 0 && (references == NULL || made->update == NULL))
        return fail(why, "%s: intermediate variables are named, but %s is NULL", function,
                    references == NULL ? "their array" : "the callback of intermediate updates");
    for (size_t k = 0; k < count; k++) {
        const fmi3ValueReference reference = references[k];
        if (reference >= (unsigned)VARIABLE_COUNT)
            return fail(why, "%s: intermediate variable %u is no variable of this FMU", function, (unsigned)reference);
        const Variable *v = &VARIABLES[reference];
        if (!is_intermediate(v))
            return fail(why, "%s: '%s' cannot be an intermediate variable: the description does not mark it with "
                        "intermediateUpdate", function, v->name);
        named[reference] = 1;
        if (v->role == ROLE_INPUT) between->supplied[v->index] = between->supplies = 1;
    }
    if (made->update == NULL) return OK;
    between->look = look_between;
    between->ask = ask_between;
    return OK;
}

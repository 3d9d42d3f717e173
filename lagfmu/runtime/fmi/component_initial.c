/* component_initial.c -- derivatives in Initialization Mode: of what begins, by start values, parameters, inputs and the
 * time, through their projection onto the constraints.
 *
 *   f'(0) = (8 (f(h) - f(-h)) - (f(2h) - f(-2h))) / 12 h + O(h^4)        (Abramowitz & Stegun 1964, 25.3.6)
 *
 * f is the start itself, found again beside the values that were set.  Where contacts or frictions begin otherwise
 * there, there is no derivative. */
#include <math.h>

#include "component.h"
#include "digits.h"

enum { LOOKS = 4 };
static const double AWAY[LOOKS] = {-2, -1, 1, 2}, WEIGHT[LOOKS] = {1.0 / 12, -8.0 / 12, 8.0 / 12, -1.0 / 12};
static const double ASIDE = 1e-3; /* of a size: h */

static int may_be_set(const Variable *v) {
    return v->place == AT_TIME || v->role == ROLE_START || v->role == ROLE_PARAMETER || v->role == ROLE_INPUT;
}

static int check_known(Component *c, const Call *call, const Group *group, unsigned known, double change) {
    Why text;
    const Variable *v = component_find(c, call, known, group);
    if (v == NULL) return CALL_ERROR;
    if (isfinite(change) && may_be_set(v)) return CALL_OK;
    (void)fail(&text, "%s: a change of '%s' by %s, expected a finite change of a start value, a parameter, an input or "
                      "the time", call->name, v->name, digits(change).text);
    return component_refuse(c, text.text);
}

static double setting_of(const Instance *x, const Variable *v) {
    return v->place == AT_TIME ? x->start_time : instance_setting(x, v);
}

static void put_setting(Instance *x, const Variable *v, double value) {
    if (v->place != AT_TIME) {
        instance_put(x, v, value);
        return;
    }
    x->start_time = value;
    x->started = 0;
    x->version += 1;
}

/* How much a known is: its value, else the size of the coordinate or speed, else 1. */
static double size_of(const Instance *x, const Variable *v) {
    const Solver *s = &x->solver;
    const int nq = s->system->nq, j = v->role == ROLE_START ? v->state : -1;
    double size = fabs(setting_of(x, v));
    if (j >= 0 && j < nq) size = fmax(size, s->state.size[j]);
    if (j >= nq && j < system_states(s->system)) size = fmax(size, s->state.span[j - nq] * s->state.now.rate);
    return size > 0 && isfinite(size) ? size : 1;
}

/* Contacts that are closed, frictions that stick, as one number. */
static unsigned long long modes_of(const Instance *x) {
    const System *s = x->solver.system;
    unsigned long long found = 14695981039346656037u; /* FNV-1a */
    for (int k = 0; k < s->contacts; k++) found = (found ^ (unsigned)x->solver.state.closed[k]) * 1099511628211u;
    for (int k = 0; k < s->frictions; k++) found = (found ^ (unsigned)x->seen.sticks[k]) * 1099511628211u;
    return found;
}

static void hear_nothing(void *context, Note note, const char *text) {
    (void)context;
    (void)note;
    (void)text;
}

/* Adds to the sums the weighted values at one look: of each unknown, or, with seeds of the unknowns, of their sum. */
static int add_values(Component *c, const Call *call, const Group *group, const unsigned unknowns[], size_t count,
                      const double *seeds, double weight, double *sums) {
    for (size_t k = 0; k < count; k++) {
        double value;
        const Variable *v = component_find(c, call, unknowns[k], group);
        if (v == NULL) return CALL_ERROR;
        if (!component_has_derivatives(v)) return component_no_derivative(c, call, v);
        if (instance_get(&c->instance, v, &value) != OK) return component_no_value(c);
        if (seeds == NULL) sums[k] += weight * value;
        else
            *sums += weight * seeds[k] * value;
    }
    return CALL_OK;
}

int component_initial(Component *c, const Call *call, const Group *group, const unsigned unknowns[],
                      size_t unknown_count, const double *seeds, const unsigned knowns[], size_t known_count,
                      const double change[], double sums[]) {
    Instance *x = &c->instance;
    double far = 0;
    for (size_t k = 0; k < known_count; k++)
        if (check_known(c, call, group, knowns[k], change[k]) != CALL_OK) return CALL_ERROR;
    if (instance_observe_unique(x) != OK) return component_no_value(c);
    for (size_t k = 0; k < known_count; k++) {
        const Variable *v = &VARIABLES[knowns[k]];
        x->set_before[knowns[k]] = setting_of(x, v);
        far = fmax(far, fabs(change[k]) / size_of(x, v));
    }
    for (size_t k = 0; k < (seeds == NULL ? unknown_count : 1); k++) sums[k] = 0;
    const double h = far > 0 ? ASIDE / far : 0;
    const unsigned long long modes = modes_of(x);
    const Tell tell = x->tell;
    int status = CALL_OK, same = 1;
    for (int look = 0; look < LOOKS && h > 0 && status == CALL_OK; look++) {
        for (size_t k = 0; k < known_count; k++)
            put_setting(x, &VARIABLES[knowns[k]], x->set_before[knowns[k]] + AWAY[look] * h * change[k]);
        x->tell = hear_nothing;
        const Status begun = instance_observe_unique(x);
        x->tell = tell;
        if (begun != OK) status = component_no_value(c);
        else
            status = add_values(c, call, group, unknowns, unknown_count, seeds, WEIGHT[look] / h, sums);
        same &= modes_of(x) == modes;
    }
    for (size_t k = 0; k < known_count; k++) put_setting(x, &VARIABLES[knowns[k]], x->set_before[knowns[k]]);
    if (status == CALL_OK && !same && unknown_count > 0) return component_no_derivative(c, call, &VARIABLES[unknowns[0]]);
    return status;
}

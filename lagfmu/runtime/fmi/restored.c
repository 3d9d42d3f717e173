/* restored.c -- is what was read from a saved state a state that this FMU can be in?
 *
 * Bytes come from a file, or from anyone.  A checksum tells altered bytes, not forged ones: an index, a
 * count, a mode or a time that no simulation has would be followed blindly.  So each number has a range,
 * and numbers that belong together are held against each other.  Whoever adds to State, Settings, Drive
 * or Instance what is saved adds a line here. */
#include "restored.h"

#include <float.h>
#include <limits.h>
#include <math.h>
#include <stddef.h>

#include "digits.h"
#include "indicators.h"
#include "optional.h"
#include "thresholds.h"

enum { MOST = INT_MAX / 2 }; /* of a count that is going to be increased */

typedef struct {
    const char *name;
    double value, low, high;
} Number;

typedef struct {
    const char *name;
    const double *values;
    int count;
    double low;
} Doubles;

typedef struct {
    const char *name;
    const int *values;
    int count, high; /* from 0 */
} Ints;

Status restored_none(Instance *x, const char *name, double value) {
    return fail(&x->solver.why, "the saved state is none of this FMU's: its %s is %s", name,
                digits(value).text);
}

static Status numbers(Instance *x, const Number *list, size_t count) {
    for (size_t k = 0; k < count; k++)
        if (!(list[k].value >= list[k].low && list[k].value <= list[k].high))
            return restored_none(x, list[k].name, list[k].value);
    return OK;
}

static Status doubles(Instance *x, const Doubles *list, size_t count) {
    for (size_t k = 0; k < count; k++)
        for (int j = 0; j < list[k].count; j++)
            if (!(list[k].values[j] >= list[k].low && list[k].values[j] <= DBL_MAX))
                return restored_none(x, list[k].name, list[k].values[j]);
    return OK;
}

static Status ints(Instance *x, const Ints *list, size_t count) {
    for (size_t k = 0; k < count; k++)
        for (int j = 0; j < list[k].count; j++)
            if (list[k].values[j] < 0 || list[k].values[j] > list[k].high)
                return restored_none(x, list[k].name, list[k].values[j]);
    return OK;
}

/* The methods that this FMU holds; before the start none may be chosen yet. */
static int offered(MethodName method) {
    return (int)method > 0 && (int)method < METHOD_COUNT && OPTIONAL.methods[method] != NULL;
}

static Status settings(Instance *x) {
    const Settings *s = &x->solver.settings, *given = &x->given;
    const Number list[] = {
        {"solver.tolerance", s->tolerance, x->started ? SMALLEST_TOLERANCE : 0, LARGEST_TOLERANCE},
        {"solver.step", s->step, 0, DBL_MAX},
        {"solver.maximum_step", s->maximum_step, 0, DBL_MAX},
        {"solver.maximum_steps", s->maximum_steps, 0, DBL_MAX},
        {"given tolerance", given->tolerance, 0, LARGEST_TOLERANCE},
        {"given step", given->step, 0, DBL_MAX},
        {"given maximum step", given->maximum_step, 0, DBL_MAX},
        {"given maximum steps", given->maximum_steps, 0, DBL_MAX},
        {"tolerance", x->tolerance, 0, LARGEST_TOLERANCE},
        {"start time", x->start_time, -DBL_MAX, DBL_MAX},
        {"stop time", x->stop_time, x->start_time, HUGE_VAL},
        {"time of the inputs", x->solver.drive.since, -DBL_MAX, DBL_MAX},
    };
    if (!offered(given->method)) return restored_none(x, "given method", (double)given->method);
    if (x->started && !offered(s->method)) return restored_none(x, "method", (double)s->method);
    if (x->started && !(x->solver.stop_time >= x->start_time))
        return restored_none(x, "stop time", x->solver.stop_time);
    return numbers(x, list, sizeof list / sizeof *list);
}

/* What the method `auto` remembers. */
static Status choice(Instance *x, const Solver *s) {
    const Choice *c = &s->state.now.choice;
    const Ints list[] = {
        {"stiffness mode", &c->implicit, 1, 1},  {"stiffness turn", &c->turn, 1, 1},
        {"stiffness memory", &c->unseen, 1, MOST}, {"stiffness memory", &c->stiff, 1, MOST},
        {"stiffness memory", &c->other, 1, MOST},  {"stiffness memory", &c->taken, 1, MOST},
        {"stiffness memory", &c->brief, 1, MOST},
        {"stiffness memory", &c->failures, 1, STIFFNESS_MOST_FAILURES},
        {"stiffness memory", &c->retries, 1, STIFFNESS_MOST_RETRIES},
    };
    const Number sizes[] = {
        {"stiffness memory", c->longest, 0, HUGE_VAL}, {"stiffness memory", c->span, 0, HUGE_VAL},
        {"time of stiffness", c->time, -DBL_MAX, DBL_MAX}, {"h rho", c->product, 0, HUGE_VAL},
        {"rho / sigma", c->ratio, 0, HUGE_VAL},
    };
    if ((c->implicit || c->turn) &&
        (s->settings.method != AUTO || OPTIONAL.methods[RADAU5] == NULL))
        return restored_none(x, "stiffness mode", c->implicit);
    if (ints(x, list, sizeof list / sizeof *list) != OK) return FAILED;
    return numbers(x, sizes, sizeof sizes / sizeof *sizes);
}

/* Time, and the step ahead. */
static Status times(Instance *x, const Solver *s) {
    const Numbers *now = &s->state.now;
    const Ints flags[] = {
        {"step count", &now->steps, 1, MOST},
        {"step count", &now->tiny, 1, MOST},
        {"count of impacts", &now->strikes, 1, MOST},
        {"mode of the step ahead", &now->ahead, 1, 1},
        {"mode of the step ahead", &now->between, 1,
         now->ahead && x->started && !x->exchange},
        {"mode of the step ahead", &now->fresh, 1, 1},
        {"rank of the constraints", &now->dependent, 1, 1},
        {"count of events", &now->event_count, 1, indicators_count(s->system)},
    };
    const Number list[] = {
        {"time", now->t, -DBL_MAX, DBL_MAX},
        {"natural rate", now->rate, 0, HUGE_VAL},
        {"step", now->step, 0, HUGE_VAL},
        {"communication step", now->span, 0, DBL_MAX},
        {"next step", now->h_next, 0, HUGE_VAL},
        {"error of the step", now->error_old, 0, HUGE_VAL},
        {"integrator's time", now->t_integrator, -DBL_MAX, DBL_MAX},
        {"integrator's time", now->t_old, -DBL_MAX, now->t_integrator},
        {"time of the event", now->event_time, -DBL_MAX, DBL_MAX},
        {"energy dissipated", now->lost, -DBL_MAX, DBL_MAX},
        {"energy dissipated", now->lost_old, -DBL_MAX, DBL_MAX},
        {"energy dissipated", now->lost_ahead, -DBL_MAX, DBL_MAX},
        {"sum of local errors", now->local.sum[0], 0, DBL_MAX},
        {"sum of local errors", now->local.sum[1], 0, DBL_MAX},
        {"largest local error", now->local.most[0], 0, now->local.sum[0]},
        {"largest local error", now->local.most[1], 0, now->local.sum[1]},
        {"sum of local errors", now->local_old.sum[0], 0, DBL_MAX},
        {"sum of local errors", now->local_old.sum[1], 0, DBL_MAX},
        {"largest local error", now->local_old.most[0], 0, now->local_old.sum[0]},
        {"largest local error", now->local_old.most[1], 0, now->local_old.sum[1]},
    };
    if (ints(x, flags, sizeof flags / sizeof *flags) != OK) return FAILED;
    if (numbers(x, list, sizeof list / sizeof *list) != OK) return FAILED;
    if (now->ahead && !(now->t <= now->t_integrator && now->t <= s->stop_time))
        return restored_none(x, "integrator's time", now->t_integrator);
    if (now->ahead && now->event_count > 0 &&
        !(now->event_time >= now->t_old && now->event_time <= now->t_integrator))
        return restored_none(x, "time of the event", now->event_time);
    return OK;
}

/* How frictions stand: a mode, a sign and, once it has been found, a unit vector. */
static Status slides(Instance *x, const Solver *s) {
    const State *a = &s->state;
    for (int k = 0; k < s->system->frictions; k++) {
        const Slide *slide = &a->slide[k];
        const double length = hypot(slide->direction[0], slide->direction[1]);
        const Ints flags[] = {{"modes", &slide->sticks, 1, 1}};
        const Number list[] = {
            {"slip velocity of rounding", slide->noise, 0, DBL_MAX},
            {"direction of slip", length, x->started ? 1 - 1e-9 : 0, 1 + 1e-9},
        };
        if (x->started && fabs(slide->sign) != 1) return restored_none(x, "sign", slide->sign);
        if (ints(x, flags, 1) != OK || numbers(x, list, 2) != OK) return FAILED;
    }
    return OK;
}

static Status arrays(Instance *x, const Solver *s) {
    const State *a = &s->state;
    const System *system = s->system;
    const int n = system->n, contacts = system->contacts, inputs = system->inputs, ny = 2 * n;
    const int watched = indicators_count(system);
    const Integrator *i = &s->integrator;
    const Method *now =
        x->started ? OPTIONAL.methods[a->now.choice.implicit ? RADAU5 : s->settings.method] : NULL;
    const Doubles list[] = {
        {"coordinates", a->q, n, -DBL_MAX},
        {"velocities", a->v, n, -DBL_MAX},
        {"sides of jumps", a->level, system->jumps, -DBL_MAX},
        {"levels", a->offset, system->m, -DBL_MAX},
        {"scales", a->scale, ny, 0},
        {"sizes", a->size, n, 0},
        {"gaps", a->gap, contacts, 0},
        {"levels of jumps", a->level, system->jumps, -DBL_MAX},
        {"departures", a->departure_time, contacts, -DBL_MAX},
        {"departures", a->departure_q, contacts * n, -DBL_MAX},
        {"departures", a->departure_v, contacts * n, -DBL_MAX},
        {"starts of slipping", a->slip_time, system->frictions, -DBL_MAX},
        {"starts of slipping", a->slip_q, system->frictions * n, -DBL_MAX},
        {"starts of slipping", a->slip_v, system->frictions * n, -DBL_MAX},
        {"indicators", a->indicator, watched, -DBL_MAX},
        {"step ahead", i->y, ny, -DBL_MAX},
        {"step ahead", i->y_old, ny, -DBL_MAX},
        {"step ahead", i->f, ny, -DBL_MAX},
        {"step ahead", i->f_old, ny, -DBL_MAX},
        {"step ahead", i->dense, now == NULL ? 0 : now->dense_arrays * ny, -DBL_MAX},
        {"inputs", s->drive.value, inputs, -DBL_MAX},
        {"inputs", s->drive.first, inputs, -DBL_MAX},
        {"inputs", s->drive.second, inputs, -DBL_MAX},
        {"inputs", x->expected, inputs, -DBL_MAX},
        {"start values", x->q0, n, -DBL_MAX},
        {"start values", x->v0, n, -DBL_MAX},
        {"parameters", s->p, system->parameters, -DBL_MAX},
    };
    const Ints flags[] = {
        {"rank of the constraints", a->basis, system->m, 1},
        {"modes", a->closed, contacts, 1}, {"modes", a->armed, contacts, 1},
        {"counts", a->count, contacts, MOST},
        {"inputs", x->set, inputs, 1},     {"counts", a->slip_count, system->frictions, MOST},
    };
    for (int k = 0; x->started && k < system->jumps; k++)
        if (!(system->floors[k] ? a->level[k] - 0.5 == floor(a->level[k])
                                : fabs(a->level[k]) == 1 || a->level[k] == 0))
            return restored_none(x, "levels of jumps", a->level[k]);
    if (doubles(x, list, sizeof list / sizeof *list) != OK) return FAILED;
    if (slides(x, s) != OK) return FAILED;
    for (int k = 0; k < watched; k++) /* 1 upwards, -1 downwards */
        if (a->left[k] < -1 || a->left[k] > 1) return restored_none(x, "events", a->left[k]);
    return ints(x, flags, sizeof flags / sizeof *flags);
}

/* The points that rates are estimated from go back in time. */
static Status pasts(Instance *x) {
    for (int i = 0; i < x->solver.system->estimated_count; i++) {
        const Past *past = &x->past[i];
        if (past->count < 0 || past->count > RATES_KEPT || !(fabs(past->rate) <= DBL_MAX))
            return restored_none(x, "past of an input", past->count);
        for (int k = 0; k < past->count; k++)
            if (!(fabs(past->u[k]) <= DBL_MAX && fabs(past->t[k]) <= DBL_MAX) ||
                (k > 0 && !(past->t[k] < past->t[k - 1])))
                return restored_none(x, "past of an input", past->t[k]);
    }
    return OK;
}

/* What the importer has set is inside of the bounds that the description states. */
static Status bounds(Instance *x) {
    for (int k = 0; k < VARIABLE_COUNT; k++) {
        const Variable *v = &VARIABLES[k];
        if (v->type != TYPE_REAL || (v->role != ROLE_PARAMETER && v->role != ROLE_SOLVER)) continue;
        const double value = instance_setting(x, v);
        if (!(value >= v->min && value <= v->max) || (v->positive && !(value > 0)))
            return restored_none(x, v->name, value);
    }
    return OK;
}

Status restored_solver(Instance *x, const Solver *s) {
    if (choice(x, s) != OK || times(x, s) != OK) return FAILED;
    return arrays(x, s);
}

Status instance_restored(Instance *x) {
    const Ints flags[] = {
        {"type", &x->exchange, 1, 1},
        {"mode", &x->started, 1, 1},
        {"mode", &x->running, 1, 1},
        {"mode", &x->warned, 1, INT_MAX}, /* bits of what has been told */
    };
    if (ints(x, flags, sizeof flags / sizeof *flags) != OK) return FAILED;
    if (x->running && !x->started) return restored_none(x, "mode", x->running);
    if (settings(x) != OK || restored_solver(x, &x->solver) != OK) return FAILED;
    if (pasts(x) != OK || bounds(x) != OK) return FAILED;
    return ERROR_BARS != NULL ? ERROR_BARS->restored(x) : OK;
}

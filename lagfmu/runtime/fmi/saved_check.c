/* saved_check.c -- is what was read from a saved state a state that this FMU can be in?
 *
 * Bytes come from a file, or from anyone.  A checksum tells altered bytes, not forged ones: an index, a
 * count, a mode or a time that no simulation has would be followed blindly.  So each number has a range,
 * and numbers that belong together are held against each other.  What is saved says in its own row (state.h,
 * instance.h) what it may be. */
#include "instance.h"

#include <float.h>
#include <limits.h>
#include <math.h>

#include "algebraic.h"
#include "digits.h"
#include "exchange.h"
#include "feature.h"
#include "indicators.h"
#include "optional.h"
#include "prescribed.h"
#include "column.h"

enum { MOST = INT_MAX / 2 }; /* of a count that is going to be increased, ... */
static const double MOST_EVER = 1 / DBL_EPSILON; /* ... and of what a run does: 2^52, in ten thousand years */

Status restored_none(Instance *x, const char *name, double value) {
    return fail(&x->solver.why, "the saved state is none of this FMU's: its %s is %s", name,
                digits(value).text);
}

/* The methods that this FMU holds; before the start none may be chosen yet. */
static int offered(int method) {
    return method > 0 && method < METHODS_MOST && OPTIONAL.methods[method] != NULL;
}

/* `many` numbers of the kind `size` bytes of each say, by themselves. */
static Status sound(Instance *x, const void *where, size_t size, int many, Sort sort, const char *name) {
    static const double LEAST[] = {0, 0, 0, 0, 0, -DBL_MAX};
    static const double LARGEST[] = {1, MOST, MOST_EVER, DBL_MAX, HUGE_VAL, DBL_MAX};
    for (int j = 0; j < many && sort != OTHER; j++) {
        const double value = size == sizeof(int) ? ((const int *)where)[j]
                             : sort == TALLY     ? (double)((const Count *)where)[j]
                                                 : ((const double *)where)[j];
        if (!(value >= LEAST[sort] && value <= LARGEST[sort])) return restored_none(x, name, value);
    }
    return OK;
}

#define SOUND(at, many, sort, name) \
    if (sound(x, at, sizeof *(at), many, sort, name) != OK) return FAILED;
#define SOUND_NUMBER(type, member, sort, name) SOUND(&of->member, 1, sort, name)
#define SOUND_ARRAY(type, member, many, sort, name) SOUND(a->member, many, sort, name)

static Status each_of_settings(Instance *x, const Settings *of) {
    SETTINGS_NUMBERS(SOUND_NUMBER)
    return OK;
}

static Status each_of_choice(Instance *x, const Choice *of) {
    CHOICE_NUMBERS(SOUND_NUMBER)
    return OK;
}

static Status each_of_approach(Instance *x, const Approach *of) {
    APPROACH_NUMBERS(SOUND_NUMBER)
    return OK;
}

static Status each_of_solver(Instance *x, const Solver *solver) {
    static const char *const HAPPENED[EVENT_KINDS] = {"departures", "closings", "starts of slipping",
                                                      "starts of sticking"};
    const System *s = solver->system;
    const State *a = &solver->state;
    const Numbers *of = &a->now;
    const Integrator *i = &solver->integrator;
    const Method *const chosen = x->started ? OPTIONAL.methods[solver->settings.method] : NULL;
    const Method *now = x->started && of->led ? OPTIONAL.methods[NO_FREEDOM] : x->started && of->choice.implicit ? OPTIONAL.implicit : chosen;
    const int width = solver_width(solver);
    if (each_of_choice(x, &of->choice) != OK || each_of_approach(x, &of->approach) != OK) return FAILED;
    STATE_NUMBERS(SOUND_NUMBER)
    STATE_ARRAYS(SOUND_ARRAY)
    STATE_ARRAYS_BEHIND(SOUND_ARRAY)
    for (int k = 0; k < EVENT_KINDS; k++) {
        const int count = event_count_of(s, (EventKind)k);
        SOUND(a->latest[k].count, count, TALLY, HAPPENED[k])
        SOUND(a->latest[k].time, count, FINITE, HAPPENED[k])
        SOUND(a->latest[k].q, count * s->nq, FINITE, HAPPENED[k])
        SOUND(a->latest[k].v, count * s->nv, FINITE, HAPPENED[k])
    }
    SOUND(i->y, width, FINITE, "step ahead")
    SOUND(i->y_old, width, FINITE, "step ahead")
    SOUND(i->f, width, FINITE, "step ahead")
    SOUND(i->f_old, width, FINITE, "step ahead")
    SOUND(i->dense, now == NULL ? 0 : now->dense_arrays * width, FINITE, "step ahead")
    SOUND(solver->drive.value, s->inputs, FINITE, "inputs")
    SOUND(solver->drive.first, s->inputs, FINITE, "inputs")
    SOUND(solver->drive.second, s->inputs, FINITE, "inputs")
    SOUND(solver->p, s->parameters, FINITE, "parameters")
    return OK;
}

static Status each_of_instance(Instance *x) {
    const System *s = x->solver.system;
    const Instance *of = x;
    INSTANCE_NUMBERS(SOUND_NUMBER)
    if (each_of_settings(x, &x->solver.settings) != OK || each_of_settings(x, &x->given) != OK) return FAILED;
    SOUND(&x->solver.drive.since, 1, FINITE, "time of the inputs")
    SOUND(x->set, s->inputs, FLAG, "inputs")
    SOUND(x->expected, s->inputs, FINITE, "inputs")
    SOUND(x->q0, s->nq, FINITE, "start values")
    SOUND(x->v0, s->nv, FINITE, "start values")
    SOUND(x->joint0, 2 * s->joint_count, FINITE, "start values")
    SOUND(x->flag, exchange_flag_count(x), FLAG, "discrete values")
    SOUND(x->multiplier, ALGEBRAIC != NULL ? s->m : 0, FINITE, "multipliers")
    return OK;
}

/* What the numbers are to each other. */
static Status together(Instance *x) {
    const Solver *s = &x->solver;
    if (x->running && !x->started) return restored_none(x, "mode", x->running);
    if (x->held && !(x->exchange && x->running)) return restored_none(x, "discrete values", 1);
    if (x->dae && !(ALGEBRAIC != NULL && x->exchange)) return restored_none(x, "DAE mode", 1);
    if (x->imposed && !(x->dae && x->running)) return restored_none(x, "multipliers", 1);
    if (x->warned < 0) return restored_none(x, "mode", x->warned); /* bits of what has been told */
    if (!offered(x->given.method)) return restored_none(x, "given method", (double)x->given.method);
    if (x->started && !offered(s->settings.method))
        return restored_none(x, "method", (double)s->settings.method);
    if (x->started && !(s->settings.tolerance > 0))
        return restored_none(x, "solver.tolerance", s->settings.tolerance);
    if (!(s->stop_time >= x->start_time)) return restored_none(x, "stop time", s->stop_time);
    return OK;
}

static Status together_in_solver(Instance *x, const Solver *s) {
    const Numbers *now = &s->state.now;
    const Choice *c = &now->choice;
    if ((c->implicit || c->turn) && (s->settings.method != AUTO || OPTIONAL.implicit == NULL))
        return restored_none(x, "stiffness mode", c->implicit);
    if (now->led && OPTIONAL.methods[NO_FREEDOM] == NULL) return restored_none(x, "freedom", now->led);
    if (c->failures > STIFFNESS_MOST_FAILURES || c->retries > STIFFNESS_MOST_RETRIES)
        return restored_none(x, "stiffness memory", c->failures + c->retries);
    if (now->approach.near && OPTIONAL.passage == NULL)
        return restored_none(x, "approach to a singular configuration", 1);
    if (now->between && !(now->ahead && x->started && !x->exchange))
        return restored_none(x, "mode of the step ahead", now->between);
    if (now->pending && (now->ahead || !x->started || x->exchange))
        return restored_none(x, "event that is reached", now->pending);
    if (now->event_count > indicators_count(s->system))
        return restored_none(x, "count of events", now->event_count);
    if (!(now->t_old <= now->t_integrator)) return restored_none(x, "integrator's time", now->t_old);
    if (now->ahead && !(now->t <= now->t_integrator && now->t <= s->stop_time))
        return restored_none(x, "integrator's time", now->t_integrator);
    if (now->ahead && now->event_count > 0 &&
        !(now->event_time >= now->t_old && now->event_time <= now->t_integrator))
        return restored_none(x, "time of the event", now->event_time);
    for (const Feature *const *f = s->features; f != NULL && *f != NULL; f++) {
        double value;
        const char *name = (*f)->flaw != NULL ? (*f)->flaw(s, x->started, x->exchange, &value) : NULL;
        if (name != NULL) return restored_none(x, name, value);
    }
    return OK;
}

/* The switch states, and the ways in which indicators leave their ranges: 1 upwards, -1 downwards. */
static Status ways(Instance *x, const Solver *s) {
    const State *a = &s->state;
    for (int k = 0; x->started && k < s->system->switches; k++)
        if (!(s->system->at_integers[k] ? a->switch_state[k] - 0.5 == floor(a->switch_state[k])
                                   : fabs(a->switch_state[k]) == 1 || a->switch_state[k] == 0))
            return restored_none(x, "switch states", a->switch_state[k]);
    for (int k = 0; k < indicators_count(s->system); k++)
        if (a->left[k] < -1 || a->left[k] > 1) return restored_none(x, "events", a->left[k]);
    return OK;
}

/* How frictions stand: a mode, a sign and, once it has been found, a unit vector. */
static Status friction_modes(Instance *x, const Solver *s) {
    for (int k = 0; k < s->system->frictions; k++) {
        const StickSlip *mode = &s->state.stick_slip[k];
        const double length = hypot(mode->direction[0], mode->direction[1]);
        if (x->started && fabs(mode->sign) != 1) return restored_none(x, "sign", mode->sign);
        if (mode->sticks < 0 || mode->sticks > 1) return restored_none(x, "modes", mode->sticks);
        if (mode->held < 0 || mode->held > 1) return restored_none(x, "modes", mode->held);
        if (!(mode->noise >= 0 && mode->noise <= DBL_MAX))
            return restored_none(x, "slip velocity of rounding", mode->noise);
        if (!(length <= 1 + 1e-9 && (!x->started || length >= 1 - 1e-9)))
            return restored_none(x, "direction of slip", length);
    }
    return OK;
}

/* What the importer has set is inside of the bounds that the description states. */
static Status check_bounds(Instance *x) {
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
    if (each_of_solver(x, s) != OK) return FAILED;
    if (together_in_solver(x, s) != OK || ways(x, s) != OK) return FAILED;
    return friction_modes(x, s);
}

Status instance_restored(Instance *x) {
    if (together(x) != OK) return FAILED;
    if (each_of_instance(x) != OK) return FAILED;
    if (restored_solver(x, &x->solver) != OK) return FAILED;
    if (check_bounds(x) != OK || (PRESCRIBED != NULL && PRESCRIBED->restored(x) != OK)) return FAILED;
    return ERROR_BARS != NULL ? ERROR_BARS->restored(x) : OK;
}

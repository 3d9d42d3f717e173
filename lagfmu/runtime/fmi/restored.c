/* restored.c -- is what was read from a saved state a state that this FMU can be in?
 *
 * Bytes come from a file, or from anyone.  A checksum tells altered bytes, not forged ones: an index, a
 * count, a mode or a time that no simulation has would be followed blindly.  So each number has a range,
 * and numbers that belong together are held against each other.  Whoever adds to State, Settings, Drive
 * or Instance what is saved adds a line here. */
#include "instance.h"

#include <float.h>
#include <limits.h>
#include <math.h>
#include <stddef.h>
#include <string.h>

#include "algebraic.h"
#include "digits.h"
#include "indicators.h"
#include "optional.h"
#include "prescribed.h"
#include "column.h"

enum { MOST = INT_MAX / 2 }; /* of a count that is going to be increased, ... */
static const double MOST_EVER = 1 / DBL_EPSILON; /* ... and of what a run does: 2^52, in ten thousand years */

/* What a number can be: an int that is 0 or 1, or counts; a count of what a run does; a double that is 0 or
 * more, and may be infinite, or any finite one. */
enum { FLAG, COUNT, TALLY, SIZE, LIMIT, FINITE };

/* How many of them there are; more than ONE stand behind a pointer. */
enum {
    ONE, COORDINATES, SPEEDS, STATES, JOINT_STARTS, ROWS, CONTACTS, CONTACTS_COORDINATES, CONTACTS_SPEEDS, FRICTIONS,
    FRICTIONS_COORDINATES, FRICTIONS_SPEEDS, INPUTS, SWITCH_STATES, PARAMETERS, PEAKS_KEPT, WATCHED, DENSE,
    STEPPED, VARIATIONS, VARIED, GIVEN_ROWS
};

typedef struct {
    const char *name;
    unsigned short at; /* of Solver or Instance */
    unsigned char sort, many;
} Saved;

#define NOW(name, member, sort) {name, offsetof(Solver, state.now.member), sort, ONE}
#define SOLVER(name, member, sort, many) {name, offsetof(Solver, member), sort, many}
#define LATEST(name, kind, many) \
    SOLVER(name, state.latest[kind].count, TALLY, many), SOLVER(name, state.latest[kind].time, FINITE, many), \
        SOLVER(name, state.latest[kind].q, FINITE, many##_COORDINATES), \
        SOLVER(name, state.latest[kind].v, FINITE, many##_SPEEDS)
#define INSTANCE(name, member, sort, many) {name, offsetof(Instance, member), sort, many}

static const Saved OF_SOLVER[] = {
    NOW("stiffness mode", choice.implicit, FLAG),
    NOW("stiffness turn", choice.turn, FLAG),
    NOW("stiffness memory", choice.unseen, COUNT),
    NOW("stiffness memory", choice.stiff, COUNT),
    NOW("stiffness memory", choice.other, COUNT),
    NOW("stiffness memory", choice.taken, COUNT),
    NOW("stiffness memory", choice.brief, COUNT),
    NOW("stiffness memory", choice.failures, COUNT),
    NOW("stiffness memory", choice.retries, COUNT),
    NOW("stiffness memory", choice.longest, LIMIT),
    NOW("stiffness memory", choice.span, LIMIT),
    NOW("time of stiffness", choice.time, FINITE),
    NOW("h rho", choice.product, LIMIT),
    NOW("rho / sigma", choice.ratio, LIMIT),
    NOW("step count", steps, TALLY),
    NOW("step count", tiny, TALLY),
    NOW("mode of the step ahead", ahead, FLAG),
    NOW("mode of the step ahead", between, FLAG),
    NOW("mode of the step ahead", fresh, FLAG),
    NOW("rank of the constraints", dependent, FLAG),
    NOW("approach to a singular configuration", approach.near, FLAG),
    NOW("approach to a singular configuration", approach.t, FINITE),
    NOW("approach to a singular configuration", approach.apart, FINITE),
    NOW("approach to a singular configuration", approach.until, FINITE),
    NOW("count of events", event_count, COUNT),
    NOW("event that is reached", pending, FLAG),
    NOW("time", t, FINITE),
    NOW("natural rate", rate, LIMIT),
    NOW("step", step, LIMIT),
    NOW("communication step", span, SIZE),
    NOW("next step", h_next, LIMIT),
    NOW("error of the step", error_old, LIMIT),
    NOW("integrator's time", t_integrator, FINITE),
    NOW("integrator's time", t_old, FINITE),
    NOW("time of the event", event_time, FINITE),
    NOW("energy dissipated", lost, FINITE),
    NOW("energy dissipated", lost_old, FINITE),
    NOW("energy dissipated", lost_ahead, FINITE),
    NOW("estimated error", estimated, SIZE),
    SOLVER("coordinates", state.q, FINITE, COORDINATES),
    SOLVER("velocities", state.v, FINITE, SPEEDS),
    SOLVER("switch states", state.switch_state, FINITE, SWITCH_STATES),
    SOLVER("offsets", state.offset, FINITE, ROWS),
    SOLVER("scales", state.scale, SIZE, STATES),
    SOLVER("sizes", state.size, SIZE, COORDINATES),
    SOLVER("sizes", state.span, SIZE, SPEEDS),
    SOLVER("gaps", state.gap, SIZE, CONTACTS),
    SOLVER("rank of the constraints", state.basis, FLAG, ROWS),
    SOLVER("modes", state.closed, FLAG, CONTACTS),
    SOLVER("modes", state.armed, FLAG, CONTACTS),
    LATEST("departures", DEPARTURE, CONTACTS),
    LATEST("closings", CLOSING, CONTACTS),
    LATEST("starts of slipping", SLIPPING, FRICTIONS),
    LATEST("starts of sticking", STICKING, FRICTIONS),
    SOLVER("impulses", state.impulse, SIZE, CONTACTS),
    SOLVER("indicators", state.indicator, FINITE, WATCHED),
    SOLVER("step ahead", integrator.y, FINITE, STEPPED),
    SOLVER("step ahead", integrator.y_old, FINITE, STEPPED),
    SOLVER("step ahead", integrator.f, FINITE, STEPPED),
    SOLVER("step ahead", integrator.f_old, FINITE, STEPPED),
    SOLVER("step ahead", integrator.dense, FINITE, DENSE),
    SOLVER("derivatives of the run", state.variation, FINITE, VARIATIONS),
    SOLVER("derivatives of the run", state.varied, FLAG, VARIED),
    SOLVER("inputs", drive.value, FINITE, INPUTS),
    SOLVER("inputs", drive.first, FINITE, INPUTS),
    SOLVER("inputs", drive.second, FINITE, INPUTS),
    SOLVER("parameters", p, FINITE, PARAMETERS),
    SOLVER("peaks", peak, FINITE, PEAKS_KEPT),
};

static const Saved OF_INSTANCE[] = {
    INSTANCE("type", exchange, FLAG, ONE),
    INSTANCE("whether an event has moved the states", moved, FLAG, ONE),
    INSTANCE("whether clocks tick", ticking, FLAG, ONE),
    INSTANCE("multipliers", imposed, FLAG, ONE),
    INSTANCE("multipliers", multiplier, FINITE, GIVEN_ROWS),
    INSTANCE("stabilization", gain, FINITE, ONE),
    INSTANCE("mode", started, FLAG, ONE),
    INSTANCE("mode", running, FLAG, ONE),
    INSTANCE("solver.tolerance", solver.settings.tolerance, SIZE, ONE),
    INSTANCE("solver.step", solver.settings.step, SIZE, ONE),
    INSTANCE("solver.maximum_step", solver.settings.maximum_step, SIZE, ONE),
    INSTANCE("solver.maximum_steps", solver.settings.maximum_steps, SIZE, ONE),
    INSTANCE("given tolerance", given.tolerance, SIZE, ONE),
    INSTANCE("given step", given.step, SIZE, ONE),
    INSTANCE("given maximum step", given.maximum_step, SIZE, ONE),
    INSTANCE("given maximum steps", given.maximum_steps, SIZE, ONE),
    INSTANCE("tolerance", tolerance, SIZE, ONE),
    INSTANCE("start time", start_time, FINITE, ONE),
    INSTANCE("time of the inputs", solver.drive.since, FINITE, ONE),
    INSTANCE("inputs", set, FLAG, INPUTS),
    INSTANCE("inputs", expected, FINITE, INPUTS),
    INSTANCE("start values", q0, FINITE, COORDINATES),
    INSTANCE("start values", v0, FINITE, SPEEDS),
    INSTANCE("start values", joint0, FINITE, JOINT_STARTS),
};

Status restored_none(Instance *x, const char *name, double value) {
    return fail(&x->solver.why, "the saved state is none of this FMU's: its %s is %s", name,
                digits(value).text);
}

/* The methods that this FMU holds; before the start none may be chosen yet. */
static int offered(MethodName method) {
    return (int)method > 0 && (int)method < METHOD_COUNT && OPTIONAL.methods[method] != NULL;
}

/* Each number of a list inside of `base`, by itself. */
static Status each(Instance *x, const Solver *s, const void *base, const Saved *list, size_t rows) {
    static const double LEAST[] = {0, 0, 0, 0, 0, -DBL_MAX};
    static const double LARGEST[] = {1, MOST, MOST_EVER, DBL_MAX, HUGE_VAL, DBL_MAX};
    const System *system = s->system;
    const Method *now = x->started ? OPTIONAL.methods[s->state.now.choice.implicit ? RADAU5 : s->settings.method]
                                   : NULL;
    const int nq = system->nq, nv = system->nv;
    const int many[] = {[ONE] = 1,
                        [COORDINATES] = nq,
                        [SPEEDS] = nv,
                        [STATES] = nq + nv,
                        [JOINT_STARTS] = 2 * system->joint_count,
                        [ROWS] = system->m,
                        [CONTACTS] = system->contacts,
                        [CONTACTS_COORDINATES] = system->contacts * nq,
                        [CONTACTS_SPEEDS] = system->contacts * nv,
                        [FRICTIONS] = system->frictions,
                        [FRICTIONS_COORDINATES] = system->frictions * nq,
                        [FRICTIONS_SPEEDS] = system->frictions * nv,
                        [INPUTS] = system->inputs,
                        [SWITCH_STATES] = system->switches,
                        [PARAMETERS] = system->parameters,
                        [PEAKS_KEPT] = peaks_saved(s->peaks, s->peak_columns),
                        [WATCHED] = indicators_count(system),
                        [DENSE] = now == NULL ? 0 : now->dense_arrays * solver_width(s),
                        [STEPPED] = solver_width(s),
                        [VARIATIONS] = s->columns * column_size(system),
                        [VARIED] = s->columns > 0,
                        [GIVEN_ROWS] = ALGEBRAIC != NULL ? system->m : 0};
    for (const Saved *row = list; row < list + rows; row++) {
        const void *where = (const char *)base + row->at;
        if (row->many != ONE) memcpy(&where, where, sizeof where);
        for (int j = 0; j < many[row->many]; j++) {
            const double value = row->sort <= COUNT   ? ((const int *)where)[j]
                                 : row->sort == TALLY ? (double)((const Count *)where)[j]
                                                      : ((const double *)where)[j];
            if (!(value >= LEAST[row->sort] && value <= LARGEST[row->sort]))
                return restored_none(x, row->name, value);
        }
    }
    return OK;
}

/* What the numbers are to each other. */
static Status together(Instance *x) {
    const Solver *s = &x->solver;
    if (x->running && !x->started) return restored_none(x, "mode", x->running);
    if (x->imposed && !(ALGEBRAIC != NULL && x->exchange && x->running)) return restored_none(x, "multipliers", 1);
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
    if ((c->implicit || c->turn) && (s->settings.method != AUTO || OPTIONAL.methods[RADAU5] == NULL))
        return restored_none(x, "stiffness mode", c->implicit);
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
    if (x->started && s->peaks > 0) { /* extremes are known as far as the state is */
        const double reached = s->peak[peaks_saved(s->peaks, s->peak_columns) - 1];
        if (x->exchange ? reached > now->t : reached != now->t) return restored_none(x, "time of the peaks", reached);
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
    if (each(x, s, s, OF_SOLVER, sizeof OF_SOLVER / sizeof *OF_SOLVER) != OK) return FAILED;
    if (together_in_solver(x, s) != OK || ways(x, s) != OK) return FAILED;
    return friction_modes(x, s);
}

Status instance_restored(Instance *x) {
    if (together(x) != OK) return FAILED;
    if (each(x, &x->solver, x, OF_INSTANCE, sizeof OF_INSTANCE / sizeof *OF_INSTANCE) != OK) return FAILED;
    if (restored_solver(x, &x->solver) != OK) return FAILED;
    if (check_bounds(x) != OK || (PRESCRIBED != NULL && PRESCRIBED->restored(x) != OK)) return FAILED;
    return ERROR_BARS != NULL ? ERROR_BARS->restored(x) : OK;
}

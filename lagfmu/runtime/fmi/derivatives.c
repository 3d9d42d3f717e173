/* derivatives.c -- the value of  sensitivity.OUTPUT.by.PARAMETER  at the state that is observed; see derivatives.h.
 *
 * With y(t, p) and its column S = dy/dp, an output w(t, y, p) has the derivative w_y S + w_p: by the tangents, or with
 * frictions, whose forces have none, by central differences of fourth order.  What a state remembers of events has a
 * column of its own. */
#include "derivatives.h"

#include <stdio.h>
#include <string.h>

#include "instance.h"
#include "optional.h"
#include "peaks.h"
#include "saltation.h"

struct Derived {
    double *value;   /* (end - first) of the variables that are derivatives, which stand together */
    int *done;       /* (columns) 1: those of a column belong to the state that is observed */
    int first, end;
    Observed seen;   /* a little beside it, and the state there is none */
    double *held;    /* (states) */
    double *q, *v;   /* (nq), (nv) of the full system: of an event */
    double *way;     /* (states) the rate of the state, with */
    double *peaked;  /* (PEAK_COUNT) values a little beside it */
};

static int is_derivative(int k) { return VARIABLES[k].place == AT_SENSITIVITY; }

static void layout_derivatives(Instance *x, Arena *scratch) {
    struct Derived counted, *d = arena_take(scratch, 1, sizeof *d);
    x->derived = d;
    if (d == NULL) d = &counted;
    for (d->end = VARIABLE_COUNT; d->end > 0 && !is_derivative(d->end - 1);) d->end -= 1;
    for (d->first = d->end; d->first > 0 && is_derivative(d->first - 1);) d->first -= 1;
    d->value = arena_doubles(scratch, d->end - d->first);
    d->done = arena_ints(scratch, COLUMN_COUNT);
    observed_layout(&d->seen, scratch, MODEL_SYSTEM);
    d->held = arena_doubles(scratch, system_states(MODEL_SYSTEM));
    const System *full = MODEL_SYSTEM->full;
    d->q = arena_doubles(scratch, full != NULL ? full->nq : 0);
    d->v = arena_doubles(scratch, full != NULL ? full->nv : 0);
    d->way = arena_doubles(scratch, system_states(MODEL_SYSTEM));
    d->peaked = arena_doubles(scratch, PEAK_COUNT);
}

/* ------------------------------------------------------------------ the run */

static Status start_again(Solver *s, void *context, int c, double part) {
    return instance_start_again(context, s->column[c].state, part);
}

static void tell_of_end(Instance *x) {
    Why text;
    if (OPTIONAL.variation->ended(&x->solver, &text)[0] == '\0') return;
    (void)snprintf(x->note, sizeof x->note,
                   "sensitivity: from here on there are no derivatives, and all of them are 0 (sensitivity.valid is "
                   "false): %.350s",
                   text.text);
    x->tell(x->context, NOTE_WARNING, x->note);
}

static Status start_derivatives(Instance *x) {
    const Status status = OPTIONAL.variation->start(&x->solver, start_again, x);
    tell_of_end(x);
    return status;
}

static void forget(Instance *x) { memset(x->derived->done, 0, (size_t)COLUMN_COUNT * sizeof(int)); }

/* ------------------------------------------------------------------ values */

/* Of the state at an event, by the coordinates of an embedding. */
static double at_event(Instance *x, const Variable *of, const double *column) {
    Solver *s = &x->solver;
    const System *system = s->system;
    const EventKind kind = event_kind(of->place);
    const Latest *latest = &s->state.latest[kind];
    const int nq = system->nq, i = of->contact;
    const double *change = column + column_of_event(system, kind, i);
    struct Derived *d = x->derived;
    memset(s->sensitivity.du, 0, (size_t)system->inputs * sizeof *s->sensitivity.du);
    system->embed_tangent(latest->time[i], latest->q + i * nq, latest->v + i * nq, s->u, s->p, change[0], change + 1,
                          change + 1 + nq, s->sensitivity.du, s->sensitivity.dp, d->q, d->v);
    return event_part(of->place) == AT_DEPARTURE_Q ? d->q[of->index] : d->v[of->index];
}

/* What a state remembers; 0 if it is something else. */
static int remembered(Instance *x, const Variable *of, int c, double *value) {
    const System *system = x->solver.system;
    const double *column = column_at(&x->solver, c);
    if (of->place == AT_IMPULSE || of->place == AT_LOST) {
        *value = column[of->place == AT_LOST ? column_of_loss(system) : column_of_impulse(system, of->index)];
        return 1;
    }
    if (is_of_peak(of->place)) {
        *value = peak_change(&x->solver, c, of->index)[of->place - AT_PEAK_MAX];
        return 1;
    }
    if (!is_of_event(of->place)) return 0;
    const double *change = column + column_of_event(system, event_kind(of->place), of->contact);
    if (event_part(of->place) == AT_DEPARTURE_TIME)
        *value = change[0];
    else if (system->full != NULL)
        *value = x->solver.state.latest[event_kind(of->place)].count[of->contact] > 0 ? at_event(x, of, column) : 0;
    else
        *value = change[1 + (event_part(of->place) == AT_DEPARTURE_V ? system->nq : 0) + of->index];
    return 1;
}

/* Everything by the tangents, along a column or, -1, the motion. */
static Status differentiate_along(Instance *x, int c, Direction *d) {
    Solver *s = &x->solver;
    Sensitivity *w = &s->sensitivity;
    if (c < 0) return instance_rates(x, d);
    const double *column = column_at(s, c);
    const int parameter = s->column[c].parameter;
    *d = (Direction){0, column, column + s->system->nq, w->du, w->dp};
    memset(w->du, 0, (size_t)s->system->inputs * sizeof *w->du);
    if (parameter >= 0) w->dp[parameter] = 1;
    const Status status = instance_differentiate(x, *d);
    if (parameter >= 0) w->dp[parameter] = 0;
    return status;
}

static Status by_tangents(Instance *x, int c) {
    struct Derived *all = x->derived;
    Direction d;
    if (differentiate_along(x, c, &d) != OK) return FAILED;
    for (int k = all->first; k < all->end; k++) {
        const Variable *of = &VARIABLES[VARIABLES[k].index];
        double *value = &all->value[k - all->first];
        if (VARIABLES[k].contact != c || remembered(x, of, c, value)) continue;
        if (instance_change(x, of, d, value) != OK) *value = 0; /* of a multiplier that is not unique */
    }
    return OK;
}

/* The state a little beside all->held, observed in all->seen: y + part S, t + part dt, p + part; parameter -1: none. */
static Status observe_beside(Solver *s, struct Derived *all, Way way, double part) {
    const int nq = s->system->nq, parameter = way.parameter;
    const double held = parameter < 0 ? 0 : s->p[parameter], t = s->state.now.t;
    for (int j = 0; j < nq; j++) s->state.q[j] = all->held[j] + part * way.dy[j];
    for (int i = 0; i < s->system->nv; i++) s->state.v[i] = all->held[nq + i] + part * way.dy[nq + i];
    if (parameter >= 0) s->p[parameter] = held + part;
    s->state.now.t = t + part * way.dt;
    const Status status = solver_observe(s, &all->seen);
    if (parameter >= 0) s->p[parameter] = held;
    s->state.now.t = t;
    return status;
}

/* Adds weight w at such a state. */
static Status add_values(Instance *x, int c, Way way, double part, double weight) {
    Solver *s = &x->solver;
    struct Derived *all = x->derived;
    Status status = observe_beside(s, all, way, part);
    for (int k = all->first; k < all->end && status == OK; k++) {
        const Variable *of = &VARIABLES[VARIABLES[k].index];
        double value = 0, *sum = &all->value[k - all->first];
        if (VARIABLES[k].contact != c || remembered(x, of, c, &value)) continue;
        status = instance_value(s, &all->seen, of, &value);
        *sum += weight * value;
    }
    return status;
}

static Status by_differences(Instance *x, int c) {
    Solver *s = &x->solver;
    struct Derived *all = x->derived;
    state_gather(s->system, s->state.q, s->state.v, all->held);
    const Way way = {0, all->held, column_at(s, c), s->column[c].parameter, NULL};
    const double step = saltation_step(s, way);
    Status status = OK;
    for (int k = all->first; k < all->end; k++)
        if (VARIABLES[k].contact == c && !remembered(x, &VARIABLES[VARIABLES[k].index], c, &all->value[k - all->first]))
            all->value[k - all->first] = 0;
    for (int r = 0; r < BESIDE_POINTS && status == OK; r++)
        status = add_values(x, c, way, step * BESIDE_AT[r], BESIDE_WEIGHT[r] / step);
    state_scatter(s->system, all->held, s->state.q, s->state.v);
    return status;
}

static Status derive(Instance *x, int c) {
    return x->solver.system->frictions > 0 ? by_differences(x, c) : by_tangents(x, c);
}

/* ------------------------------------------------------------------ extremes */

/* Changes (PEAK_COUNT) of the quantities whose extremes are kept: by differences. */
static Status peaked_by_differences(Instance *x, int c, double *changes) {
    Solver *s = &x->solver;
    struct Derived *all = x->derived;
    state_gather(s->system, s->state.q, s->state.v, all->held);
    if (c < 0 && saltation_flow(s, s->state.now.t, all->held, all->way) != OK) return FAILED;
    const Way way = {c < 0, all->held, c < 0 ? all->way : column_at(s, c), c < 0 ? -1 : s->column[c].parameter, NULL};
    const double step = saltation_step(s, way);
    Status status = OK;
    memset(changes, 0, (size_t)PEAK_COUNT * sizeof *changes);
    for (int r = 0; r < BESIDE_POINTS && status == OK; r++) {
        status = observe_beside(s, all, way, step * BESIDE_AT[r]);
        if (status == OK) status = s->measure(s, &all->seen, all->peaked);
        for (int k = 0; k < PEAK_COUNT; k++) changes[k] += BESIDE_WEIGHT[r] / step * all->peaked[k];
    }
    state_scatter(s->system, all->held, s->state.q, s->state.v);
    return status;
}

static Status change_of_peaked(Solver *s, int c, double *changes) {
    Instance *x = s->caller;
    Direction d;
    if (s->system->frictions > 0) return peaked_by_differences(x, c, changes);
    if (solver_observe(s, &x->seen) != OK) return FAILED;
    x->observed = 1; /* of this state, until it has been differentiated */
    const Status status = differentiate_along(x, c, &d);
    for (int k = 0; k < PEAK_COUNT && status == OK; k++)
        if (instance_change(x, &PEAKED[k], d, &changes[k]) != OK) changes[k] = 0;
    x->observed = x->evaluated = 0;
    return status;
}

static const char *name_of_asked(int c, int k, int part) {
    for (int j = 0; j < VARIABLE_COUNT; j++) {
        const Variable *of = is_derivative(j) && VARIABLES[j].contact == c ? &VARIABLES[VARIABLES[j].index] : NULL;
        if (of != NULL && of->index == k && of->place == (Place)(AT_PEAK_MAX + part)) return of->name;
    }
    return NULL;
}

static int any_of_peaks(void) {
    for (int j = 0; j < VARIABLE_COUNT; j++)
        if (is_derivative(j) && is_of_peak(VARIABLES[VARIABLES[j].index].place)) return 1;
    return 0;
}

static void prepare_peaks(Instance *x) {
    x->solver.caller = x;
    x->solver.peak_columns = any_of_peaks() ? COLUMN_COUNT : 0;
    x->solver.measure_change = change_of_peaked;
    x->solver.peak_asked = name_of_asked;
}

/* ------------------------------------------------------------------ */

static Status get_derivative(Instance *x, const Variable *v, double *value) {
    struct Derived *all = x->derived;
    *value = 0;
    if (instance_observe(x) != OK) return FAILED;
    if (!*x->solver.state.varied) return OK;
    if (v->place == AT_SENSITIVITY_VALID) {
        *value = 1;
        return OK;
    }
    if (!all->done[v->contact]) {
        if (derive(x, v->contact) != OK) return FAILED;
        all->done[v->contact] = 1;
    }
    *value = all->value[(int)(v - VARIABLES) - all->first];
    return OK;
}

SHARED_VALUE const Derivatives OF_RUN = {prepare_peaks, layout_derivatives, start_derivatives, forget, get_derivative, tell_of_end};

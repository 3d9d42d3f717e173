/* derivatives.c -- the value of  sensitivity.OUTPUT.by.PARAMETER  at the state that is observed; see derivatives.h.
 *
 * With y(t, p) and its column S = dy/dp, an output w(t, y, p) has the derivative w_y S + w_p, by the tangents; all of
 * them are found at once.  What a state remembers of events lies ready in the column. */
#include "derivatives.h"

#include <float.h>
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "column.h"
#include "instance.h"
#include "optional.h"
#include "peaks.h"

struct Derived {
    double *value;   /* (end[COLUMN_COUNT - 1] - first) of the variables that are derivatives, column by column */
    int first, *end; /* the position of the first, and (columns) the one behind the last of each */
    unsigned long done; /* the version of the state that the values belong to */
    int moving;      /* 1: some are of the motion, not of what a state remembers */
    double *q, *v;   /* (nq), (nv) of the full system: of an event */
};

static int is_derivative(int k) { return VARIABLES[k].place == AT_SENSITIVITY; }

/* Does a state remember it, of an event or an extreme? */
static int is_remembered(const Variable *of) {
    return of->place == AT_IMPULSE || of->place == AT_LOST || is_of_peak(of->place) || is_of_event(of->place);
}

static void layout_derivatives(Instance *x, Arena *scratch) {
    struct Derived counted, *d = arena_take(scratch, 1, sizeof *d);
    x->derived = d;
    if (d == NULL) d = &counted;
    d->end = arena_ints(scratch, COLUMN_COUNT);
    int k = VARIABLE_COUNT;
    while (k > 0 && !is_derivative(k - 1)) k -= 1;
    const int end = k;
    while (k > 0 && is_derivative(k - 1)) k -= 1;
    d->first = k;
    d->moving = 0;
    for (int j = k; j < end && d->end != NULL; j++) {
        d->end[VARIABLES[j].contact] = j + 1;
        d->moving |= !is_remembered(&VARIABLES[VARIABLES[j].index]);
    }
    d->value = arena_doubles(scratch, end - k);
    const System *full = MODEL_SYSTEM->full;
    d->q = arena_doubles(scratch, full != NULL ? full->nq : 0);
    d->v = arena_doubles(scratch, full != NULL ? full->nv : 0);
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

/* ------------------------------------------------------------------ values */

/* Of the state at an event, by the coordinates of an embedding. */
static double at_event(Instance *x, const Variable *of, int c) {
    Solver *s = &x->solver;
    Sensitivity *w = &s->sensitivity;
    const System *system = s->system;
    const EventKind kind = event_kind(of->place);
    const Latest *latest = &s->state.latest[kind];
    const int nq = system->nq, i = of->contact, parameter = s->column[c].parameter;
    const double *change = column_at(s, c) + column_of_event(system, kind, i);
    struct Derived *d = x->derived;
    memset(w->du, 0, (size_t)system->inputs * sizeof *w->du);
    if (parameter >= 0) w->dp[parameter] = 1;
    system->embed_tangent(latest->time[i], latest->q + i * nq, latest->v + i * nq, s->u, s->p, change[0], change + 1,
                          change + 1 + nq, w->du, w->dp, d->q, d->v);
    if (parameter >= 0) w->dp[parameter] = 0;
    return event_part(of->place) == AT_DEPARTURE_Q ? d->q[of->index] : d->v[of->index];
}

/* What a state remembers. */
static double remembered(Instance *x, const Variable *of, int c) {
    const System *system = x->solver.system;
    const double *column = column_at(&x->solver, c);
    if (of->place == AT_IMPULSE) return column[column_of_impulse(system, of->index)];
    if (of->place == AT_LOST) return column[column_of_loss(system)];
    if (is_of_peak(of->place)) return peak_change(peaks_of(&x->solver), c, of->index)[of->place - AT_PEAK_MAX];
    const double *change = column + column_of_event(system, event_kind(of->place), of->contact);
    if (event_part(of->place) == AT_DEPARTURE_TIME) return change[0];
    if (system->full == NULL)
        return change[1 + (event_part(of->place) == AT_DEPARTURE_V ? system->nq : 0) + of->index];
    return x->solver.state.latest[event_kind(of->place)].count[of->contact] > 0 ? at_event(x, of, c) : 0;
}

/* Everything along a column. */
Status derivatives_along(Instance *x, int c, Direction *d) {
    Solver *s = &x->solver;
    Sensitivity *w = &s->sensitivity;
    const double *column = column_at(s, c);
    const int parameter = s->column[c].parameter;
    *d = (Direction){0, column, column + s->system->nq, w->du, w->dp};
    memset(w->du, 0, (size_t)s->system->inputs * sizeof *w->du);
    if (parameter >= 0) w->dp[parameter] = 1;
    const Status status = instance_differentiate_factored(x, *d, sensitivity_along);
    if (parameter >= 0) w->dp[parameter] = 0;
    return status;
}

static Status derive(Instance *x) {
    struct Derived *all = x->derived;
    Direction d;
    if (all->moving && instance_factor(x) != OK) return FAILED;
    for (int c = 0, k = all->first; c < COLUMN_COUNT; c++) {
        if (all->moving && derivatives_along(x, c, &d) != OK) return FAILED;
        for (; k < all->end[c]; k++) {
            const Variable *of = &VARIABLES[VARIABLES[k].index];
            double *value = &all->value[k - all->first];
            if (is_remembered(of))
                *value = remembered(x, of, c);
            else if (instance_change(x, of, d, value) != OK)
                *value = 0; /* of a multiplier that is not unique */
        }
    }
    all->done = x->version;
    return OK;
}

/* How many columns extremes are differentiated by. */
static int of_peaks(int columns) {
    for (int j = 0; j < VARIABLE_COUNT; j++)
        if (is_derivative(j) && is_of_peak(VARIABLES[VARIABLES[j].index].place)) return columns;
    return 0;
}

const Variable *derivatives_of(int j) { return is_derivative(j) ? &VARIABLES[VARIABLES[j].index] : NULL; }

/* ------------------------------------------------------------------ */

/* Below the normal numbers a derivative is what rounding has left of numbers that cancel. */
static double shown(double derivative) { return fabs(derivative) < DBL_MIN ? 0 : derivative; }

static Status get_derivative(Instance *x, const Variable *v, double *value) {
    struct Derived *all = x->derived;
    const int at = (int)(v - VARIABLES) - all->first;
    *value = 0;
    if (all->done == x->version && v->place == AT_SENSITIVITY) {
        *value = shown(all->value[at]);
        return OK;
    }
    if (instance_observe_unique(x) != OK) return FAILED;
    if (!*x->solver.state.varied) return OK;
    if (v->place == AT_SENSITIVITY_VALID) {
        *value = 1;
        return OK;
    }
    if (all->done != x->version && derive(x) != OK) return FAILED;
    *value = shown(all->value[at]);
    return OK;
}

SHARED_VALUE const Derivatives OF_RUN = {of_peaks, &PEAK_CHANGES, layout_derivatives, start_derivatives, get_derivative, tell_of_end};

/* error_bars.c -- error bars by a finer run; see error_bars.h.
 *
 * Events pair by their count: while one of the runs has met an event that the other has not, a difference
 * says nothing and the bar is infinite, for which the largest double stands.  Beside a method of fixed
 * steps the finer run takes twice as many. */
#include "error_bars.h"

#include <float.h>
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "digits.h"
#include "instance.h"
#include "nominals.h"
#include "optional.h"
#include "segment.h"

static const double INFINITE = DBL_MAX;
/* Of error_bars.h; MARGIN, SPREAD, ESTIMATE and ROUNDING are calibrated: benchmarks/error_bars.py --drawn. */
static const double FINER = 0.1;    /* the finer run's tolerance, in that of the delivered run */
static const double SHORTER = 0.7;  /* its first and its longest step, in the delivered run's */
static const double MARGIN = 6, SPREAD = 0.03, ESTIMATE = 2, BAR_ROUNDING = 16;

/* ------------------------------------------------------------------ memory */

static void find_bars(Bars *b) {
    b->end = VARIABLE_COUNT;
    while (b->end > 0 && VARIABLES[b->end - 1].place != AT_ERROR) b->end -= 1;
    b->first = b->end;
    while (b->first > 0 && VARIABLES[b->first - 1].place == AT_ERROR) b->first -= 1;
}

static void layout_bars(Instance *x, Arena *saved, Arena *scratch) {
    Bars counted, *b = arena_take(scratch, 1, sizeof *b);
    x->bars = b;
    if (b == NULL) b = memset(&counted, 0, sizeof counted);
    find_bars(b);
    const int count = b->end - b->first;
    solver_layout(&b->solver, saved, scratch, MODEL_SYSTEM);
    b->solver.p = x->solver.p;
    b->solver.on_demand = 1;
    observed_layout(&b->seen, scratch, MODEL_SYSTEM);
    b->state = arena_doubles(scratch, system_states(MODEL_SYSTEM));
    b->scale = arena_doubles(scratch, system_states(MODEL_SYSTEM));
    b->push = arena_doubles(scratch, (MODEL_SYSTEM->full != NULL ? MODEL_SYSTEM->full : MODEL_SYSTEM)->nv);
    b->kept = arena_take(saved, 1, sizeof *b->kept);
    b->worst = arena_doubles(saved, count);
    b->size = arena_doubles(saved, count);
    b->lost = arena_ints(saved, 1);
}

/* ------------------------------------------------------------------ settings */

static int has_fixed_step(const Instance *x) {
    return OPTIONAL.methods[x->solver.settings.method]->fixed;
}

/* What the finer run shares with the delivered run, but for the tolerance. */
static void share_settings(Instance *x) {
    Solver *c = &x->bars->solver;
    const double step = c->settings.step;
    c->drive = x->solver.drive;
    c->stop_time = x->solver.stop_time;
    c->settings = x->solver.settings;
    c->settings.tolerance *= FINER;
    c->limit = has_fixed_step(x) ? 0 : SHORTER * x->solver.taken;
    if (has_fixed_step(x)) c->settings.step = step;
}

/* The fixed step that was asked for: solver.step, or what the motion's natural rate says. */
static double asked_step(const Instance *x, double span) {
    const Solver *s = &x->solver;
    const int known = s->state.now.rate > 0 && isfinite(s->state.now.rate);
    if (x->given.step > 0) return x->given.step;
    return known ? segment_natural_step(s) : span / segment_fewest_steps(s);
}

/* ------------------------------------------------------------------ a run */

static void start_bars(Instance *x) {
    Bars *b = x->bars;
    const size_t bars = (size_t)(b->end - b->first) * sizeof *b->worst;
    b->solver.settings.step = 0;
    share_settings(x);
    b->solver.state.now = x->solver.state.now;
    memcpy(b->solver.state.block, x->solver.state.block, x->solver.state.block_size);
    memset(b->worst, 0, bars);
    memset(b->size, 0, bars);
    *b->lost = 0;
}

static void lose_bars(Instance *x, const char *why) {
    Bars *b = x->bars;
    *b->lost = 1;
    (void)snprintf(x->note, sizeof x->note,
                   "error bars: the finer run at the tolerance %s cannot follow to t = %s s, all bars "
                   "are infinite (%s) from here: %.250s",
                   digits(b->solver.settings.tolerance).text, digits(x->solver.state.now.t).text,
                   digits(INFINITE).text, why);
    x->tell(x->context, NOTE_WARNING, x->note);
}

static void follow_delivered(Instance *x, double t_end) {
    Bars *b = x->bars;
    if (*b->lost) return;
    share_settings(x);
    if (b->solver.state.now.steps == 0 && !has_fixed_step(x))
        b->solver.state.now.step = SHORTER * x->solver.first; /* both may choose the same first step */
    if (solver_pass(&b->solver, t_end)) return;
    if (solver_advance(&b->solver, t_end) != OK) lose_bars(x, b->solver.why.text);
}

static void inputs_changed(Instance *x) {
    if (!*x->bars->lost) solver_inputs_changed(&x->bars->solver);
}

/* A look at the state with which the next step begins; one that cannot be found is told by that step. */
static void turn(Instance *x) {
    Bars *b = x->bars;
    if (*b->lost) return;
    share_settings(x);
    *b->lost = solver_look(&b->solver) != OK;
}

/* ------------------------------------------------------------------ bars */

static int modes_paired(const StickSlip *a, const StickSlip *b) {
    const double turn = a->direction[0] * b->direction[0] + a->direction[1] * b->direction[1];
    return a->sticks == b->sticks && (a->sticks || (a->sign == b->sign && turn >= 0));
}

/* Have both runs met the same events, and stand in the same modes? */
static int have_met_the_same(const Solver *a, const Solver *b) {
    const System *s = a->system;
    const State *x = &a->state, *y = &b->state;
    int paired = 1;
    for (int k = 0; k < EVENT_KINDS; k++)
        for (int i = 0; i < event_count_of(s, (EventKind)k); i++)
            paired &= x->latest[k].count[i] == y->latest[k].count[i];
    for (int c = 0; c < s->contacts; c++) paired &= x->closed[c] == y->closed[c];
    for (int k = 0; k < s->switches; k++) paired &= x->switch_state[k] == y->switch_state[k];
    for (int k = 0; k < s->frictions; k++) paired &= modes_paired(&x->stick_slip[k], &y->stick_slip[k]);
    return paired;
}

/* The time of an event pairs by the count of its own kind. */
static int is_paired_for(const Variable *of, const Solver *a, const Solver *b, int all) {
    if (!is_of_event(of->place)) return all;
    const EventKind kind = event_kind(of->place);
    return a->state.latest[kind].count[of->contact] == b->state.latest[kind].count[of->contact];
}

/* Of what is looked at: scales, the forces that may cancel, and how far the two motions are apart. */
static void measure_difference(Instance *x) {
    Bars *b = x->bars;
    const System *own = x->solver.system, *full = own->full != NULL ? own->full : own;
    const State *state = &x->solver.state, *other = &b->solver.state;
    state_gather(own, state->q, state->v, b->state);
    nominals_shared(&x->solver, b->state, b->scale);
    for (int j = 0; j < full->nv; j++) b->push[j] = fabs(x->seen.applied[j]);
    for (int e = 0; e < full->entries; e++) b->push[full->entry_column[e]] += fabs(x->seen.share[e]);
    b->paired = have_met_the_same(&x->solver, &b->solver);
    b->apart = ESTIMATE * state->now.estimated;
    for (int j = 0; j < system_states(own) && b->paired; j++) {
        const double off = b->state[j] - (j < own->nq ? other->q[j] : other->v[j - own->nq]);
        const double size = fmax(fabs(b->state[j]), b->scale[j]);
        if (off != 0) b->apart = fmax(b->apart, fmin(fabs(off) / size, 1));
    }
}

/* Both runs can be read at the present state and inputs. */
static Status observe_both(Instance *x) {
    Bars *b = x->bars;
    if (instance_observe(x) != OK) return FAILED;
    if (*b->lost || b->observed == x->version) return OK;
    share_settings(x);
    if (solver_arrive(&b->solver) == OK && solver_observe(&b->solver, &b->seen) == OK) {
        b->observed = x->version;
        measure_difference(x);
    } else {
        lose_bars(x, b->solver.why.text);
    }
    return OK;
}

/* What the scales of the speeds make of the rate of coordinate j. */
static double size_of_rate(const Instance *x, int j) {
    const System *s = x->solver.system;
    double size = 0;
    for (int e = 0; e < s->rates; e++)
        if (s->rate_row[e] == j) size += fabs(x->solver.stepped.B[e]) * x->bars->scale[s->nq + s->rate_column[e]];
    return size;
}

/* Below what it rounds: of a state or its rate the scale of the motion, of a force that of the forces that may cancel in
 * it, of a multiplier that of all that acts on a coordinate on which it does. */
static double natural_size(const Instance *x, const Variable *of) {
    const System *own = x->solver.system, *full = own->full != NULL ? own->full : own;
    const Observed *o = &x->seen;
    const double *push = x->bars->push;
    double size = HUGE_VAL;
    if (variable_state(of) >= 0) return x->bars->scale[variable_state(of)];
    if (of->place == AT_QDOT) return size_of_rate(x, of->index);
    if (of->place == AT_FORCE) return push[of->index];
    if (of->place == AT_SHARE) return push[full->entry_column[of->index]];
    if (of->place != AT_LAMBDA) return 0;
    for (int e = 0; e < full->entries; e++)
        if (full->entry_row[e] == of->index && o->share[e] != 0)
            size = fmin(size, push[full->entry_column[e]] * fabs(o->lambda[of->index] / o->share[e]));
    return size < HUGE_VAL ? size : 0;
}

/* What a variable that is as large as `size` rounds: the place of a body has the digits of its surroundings. */
static double rounding(const Instance *x, const Variable *of, double size) {
    const State *s = &x->solver.state;
    if (of->state >= 0) size = fmax(size, nominals_natural(&x->solver, of->state));
    return BAR_ROUNDING * DBL_EPSILON * sqrt(1 + (double)s->now.steps) * size;
}

/* The bar that differences ask for and the magnitude of a variable so far, with the present ones; 0 if there
 * is no difference to take. */
static int compare(Instance *x, const Variable *bar, double *worst, double *size) {
    Bars *b = x->bars;
    const Variable *of = &VARIABLES[bar->index];
    double mine = 0, other = 0;
    *worst = b->worst[bar->contact];
    *size = b->size[bar->contact];
    if (instance_value(&x->solver, &x->seen, of, &mine) != OK) return 0;
    if (is_of_event(of->place)) {
        const Count count = x->solver.state.latest[event_kind(of->place)].count[of->contact];
        *size = count > 0 ? fmax(fabs(x->start_time), fabs(x->solver.state.now.t)) : 0;
    } else {
        *size = fmax(*size, fmax(fabs(mine), natural_size(x, of)));
    }
    if (!is_paired_for(of, &x->solver, &b->solver, b->paired)) return 0;
    if (instance_value(&b->solver, &b->seen, of, &other) != OK) return 0;
    if (mine == other) return 1; /* of no coordinate, or known exactly */
    const double off = fmax(fabs(mine - other), SPREAD * b->apart * *size);
    *worst = fmin(fmax(*worst, MARGIN * off), INFINITE);
    return 1;
}

static void widen(Instance *x) {
    Bars *b = x->bars;
    if (*b->lost || observe_both(x) != OK || *b->lost) return;
    for (int k = b->first; k < b->end; k++) {
        const Variable *bar = &VARIABLES[k];
        double worst, size;
        (void)compare(x, bar, &worst, &size);
        b->worst[bar->contact] = worst;
        b->size[bar->contact] = size;
    }
}

/* Of fixed steps, n to t_end for the delivered run and 2 n for the finer run. */
static void begin_bars(Instance *x, double t_end) {
    const double span = t_end - x->solver.state.now.t;
    if (!has_fixed_step(x) || !(span > 0) || !isfinite(span)) return;
    const double steps = fmax(ceil(span / asked_step(x, span) * (1 - 1e-12)), 1);
    x->bars->solver.settings.step = span / (2 * steps);
}

static Status get_bar(Instance *x, const Variable *v, double *value) {
    Bars *b = x->bars;
    double worst, size;
    if (observe_both(x) != OK) return FAILED;
    *value = INFINITE;
    if (*b->lost) return OK;
    if (!compare(x, v, &worst, &size)) return OK;
    *value = fmin(fmax(worst, rounding(x, &VARIABLES[v->index], size)), INFINITE);
    return OK;
}

/* ------------------------------------------------------------------ saved states */

static void save(const Instance *x) {
    memcpy(x->bars->kept, &x->bars->solver.state.now, sizeof *x->bars->kept);
}

static void restore(Instance *x) {
    Bars *b = x->bars;
    b->solver.state.now = *b->kept;
}

static Status restored_bars(Instance *x) {
    const Bars *b = x->bars;
    if (!x->started) return OK;
    share_settings(x);
    if (*b->lost != 0 && *b->lost != 1) return restored_none(x, "finer run", *b->lost);
    for (int k = 0; k < b->end - b->first; k++) {
        if (!(b->worst[k] >= 0 && b->worst[k] <= DBL_MAX))
            return restored_none(x, "error bar", b->worst[k]);
        if (!(b->size[k] >= 0 && b->size[k] <= DBL_MAX))
            return restored_none(x, "error bar", b->size[k]);
    }
    if (*b->lost) return OK; /* of the finer run nothing is used any more */
    if (b->solver.state.now.t != x->solver.state.now.t)
        return restored_none(x, "finer run's time", b->solver.state.now.t);
    return restored_solver(x, &b->solver);
}

SHARED_VALUE const ErrorBars BARS = {layout_bars,         start_bars, widen, begin_bars, follow_delivered,
                        inputs_changed, turn,  get_bar,   save,       restore, restored_bars};

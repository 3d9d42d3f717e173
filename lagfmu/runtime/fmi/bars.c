/* bars.c -- error bars by a companion run at a coarser tolerance; see bars.h.
 *
 * Events pair by their count: while one of the runs has met an event that the other has not, a difference
 * says nothing and the bar is infinite, for which the largest double stands.  A method of fixed steps
 * delivers twice as many steps as were asked for, and its companion takes those that were. */
#include "bars.h"

#include <float.h>
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "companion.h"
#include "digits.h"
#include "instance.h"
#include "flow.h"
#include "optional.h"
#include "restored.h"

static const double INFINITE = DBL_MAX;

/* ------------------------------------------------------------------ memory */

static void find_bars(Bars *b) {
    b->end = VARIABLE_COUNT;
    while (b->end > 0 && VARIABLES[b->end - 1].place != AT_ERROR) b->end -= 1;
    b->first = b->end;
    while (b->first > 0 && VARIABLES[b->first - 1].place == AT_ERROR) b->first -= 1;
}

static void layout(Instance *x, Arena *saved, Arena *scratch) {
    Bars counted, *b = arena_take(scratch, 1, sizeof *b);
    x->bars = b;
    if (b == NULL) b = memset(&counted, 0, sizeof counted);
    find_bars(b);
    const int count = b->end - b->first;
    solver_layout(&b->solver, saved, scratch, MODEL_SYSTEM);
    b->solver.p = x->solver.p;
    b->solver.on_demand = 1;
    b->solver.alike = companion_alike(BAR_COARSER);
    x->solver.alike = HUGE_VAL;
    observed_layout(&b->seen, scratch, MODEL_SYSTEM);
    b->kept = arena_take(saved, 1, sizeof *b->kept);
    b->worst = arena_doubles(saved, count);
    b->size = arena_doubles(saved, count);
    b->lost = arena_ints(saved, 1);
}

/* ------------------------------------------------------------------ settings */

static int has_fixed_step(const Instance *x) {
    return OPTIONAL.methods[x->solver.settings.method]->fixed;
}

/* What the companion shares with the delivered run, but for the tolerance. */
static void share(Instance *x) {
    Solver *c = &x->bars->solver;
    const double step = c->settings.step;
    c->drive = x->solver.drive;
    c->stop_time = x->solver.stop_time;
    c->settings = x->solver.settings;
    c->settings.tolerance *= BAR_COARSER;
    if (has_fixed_step(x)) c->settings.step = step;
}

/* The fixed step that was asked for: solver.step, or what the motion's natural rate says. */
static double asked_step(const Instance *x, double span) {
    const Solver *s = &x->solver;
    const int known = s->state.now.rate > 0 && isfinite(s->state.now.rate);
    if (x->given.step > 0) return x->given.step;
    return known ? flow_natural_step(s) : span / flow_fewest_steps(s);
}

static void tell_halved(Instance *x) {
    const double step = asked_step(x, 0);
    if (!(step > 0)) return;
    (void)snprintf(x->note, sizeof x->note,
                   "error bars: %s delivers a run of half the step, %s s in place of %s s, which the "
                   "companion takes",
                   METHOD_NAMES[x->solver.settings.method], digits(step / 2).text, digits(step).text);
    x->tell(x->context, x->given.step > 0 ? NOTE_WARNING : NOTE_EVENT, x->note);
}

/* ------------------------------------------------------------------ a run */

static void start(Instance *x) {
    Bars *b = x->bars;
    const size_t bars = (size_t)(b->end - b->first) * sizeof *b->worst;
    b->solver.settings.step = 0;
    share(x);
    b->solver.state.now = x->solver.state.now;
    memcpy(b->solver.state.block, x->solver.state.block, x->solver.state.block_size);
    memset(b->worst, 0, bars);
    memset(b->size, 0, bars);
    *b->lost = 0;
    b->observed = 0;
    if (has_fixed_step(x)) tell_halved(x);
}

static void lose(Instance *x, const char *why) {
    Bars *b = x->bars;
    *b->lost = 1;
    (void)snprintf(x->note, sizeof x->note,
                   "error bars: the companion run at the tolerance %s cannot follow to t = %s s, all bars "
                   "are infinite (%s) from here: %.250s",
                   digits(b->solver.settings.tolerance).text, digits(x->solver.state.now.t).text,
                   digits(INFINITE).text, why);
    x->tell(x->context, NOTE_WARNING, x->note);
}

static void follow(Instance *x, double t_end) {
    Bars *b = x->bars;
    b->observed = 0;
    if (*b->lost) return;
    share(x);
    if (solver_pass(&b->solver, t_end)) return;
    if (solver_advance(&b->solver, t_end) != OK) lose(x, b->solver.why.text);
}

static void inputs_changed(Instance *x) {
    if (!*x->bars->lost) solver_inputs_changed(&x->bars->solver);
}

/* A look at the state with which the next step begins; one that cannot be found is told by that step. */
static void turn(Instance *x) {
    Bars *b = x->bars;
    b->observed = 0;
    if (*b->lost) return;
    share(x);
    *b->lost = solver_look(&b->solver) != OK;
}

/* ------------------------------------------------------------------ bars */

/* The time of an event pairs by the count of its own kind. */
static int is_paired_for(const Variable *of, const Solver *a, const Solver *b, int all) {
    if (!is_of_event(of->place)) return all;
    const EventKind kind = event_kind(of->place);
    return a->state.latest[kind].count[of->contact] == b->state.latest[kind].count[of->contact];
}

/* Both runs can be read at the present state and inputs. */
static Status look(Instance *x) {
    Bars *b = x->bars;
    if (instance_observe(x) != OK) return FAILED;
    if (*b->lost || b->observed) return OK;
    share(x);
    if (solver_arrive(&b->solver) == OK && solver_observe(&b->solver, &b->seen) == OK)
        b->observed = 1;
    else
        lose(x, b->solver.why.text);
    return OK;
}

/* The bar that differences ask for and the magnitude of a variable so far, with the present ones; 0 if there
 * is no difference to take. */
static int compare(Instance *x, const Variable *bar, int paired, double share, double *worst,
                   double *size) {
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
        *size = fmax(*size, fabs(mine));
        if (of->state >= 0) *size = fmax(*size, x->solver.state.scale[of->state]);
    }
    if (!is_paired_for(of, &x->solver, &b->solver, paired)) return 0;
    if (instance_value(&b->solver, &b->seen, of, &other) != OK) return 0;
    const double off = fabs(mine - other), part = fmax(share, fmin(1, share + off / *size));
    *worst = fmin(fmax(*worst, part * off), INFINITE);
    return 1;
}

/* The part of a difference that is the bar: all of it where a fixed step is halved. */
static double share_of(const Instance *x) {
    if (has_fixed_step(x)) return 1;
    return companion_share(&x->solver, &x->bars->solver, BAR_MARGIN, BAR_FEW);
}

static void widen(Instance *x) {
    Bars *b = x->bars;
    if (*b->lost || look(x) != OK || *b->lost) return;
    const int paired = companion_paired(&x->solver, &b->solver);
    const double part = share_of(x);
    for (int k = b->first; k < b->end; k++) {
        const Variable *bar = &VARIABLES[k];
        double worst, size;
        (void)compare(x, bar, paired, part, &worst, &size);
        b->worst[bar->contact] = worst;
        b->size[bar->contact] = size;
    }
}

/* Of fixed steps, n to t_end for the companion and 2 n for the delivered run. */
static void begin_step(Instance *x, double t_end) {
    const double span = t_end - x->solver.state.now.t;
    if (!has_fixed_step(x) || !(span > 0) || !isfinite(span)) return;
    const double steps = fmax(ceil(span / asked_step(x, span) * (1 - 1e-12)), 1);
    x->bars->solver.settings.step = span / steps;
    x->solver.settings.step = span / (2 * steps);
}

static Status get(Instance *x, const Variable *v, double *value) {
    Bars *b = x->bars;
    double worst, size;
    if (look(x) != OK) return FAILED;
    *value = INFINITE;
    if (*b->lost) return OK;
    const int paired = companion_paired(&x->solver, &b->solver);
    if (!compare(x, v, paired, share_of(x), &worst, &size)) return OK;
    const double steps = 1 + (double)x->solver.state.now.steps;
    *value = fmin(fmax(worst, BAR_ROUNDING * DBL_EPSILON * sqrt(steps) * size), INFINITE);
    return OK;
}

/* ------------------------------------------------------------------ saved states */

static void save(const Instance *x) {
    memcpy(x->bars->kept, &x->bars->solver.state.now, sizeof *x->bars->kept);
}

static void restore(Instance *x) {
    Bars *b = x->bars;
    b->solver.state.now = *b->kept;
    b->observed = 0;
}

static Status restored(Instance *x) {
    const Bars *b = x->bars;
    if (!x->started) return OK;
    share(x);
    if (*b->lost != 0 && *b->lost != 1) return restored_none(x, "companion", *b->lost);
    for (int k = 0; k < b->end - b->first; k++) {
        if (!(b->worst[k] >= 0 && b->worst[k] <= DBL_MAX))
            return restored_none(x, "error bar", b->worst[k]);
        if (!(b->size[k] >= 0 && b->size[k] <= DBL_MAX))
            return restored_none(x, "error bar", b->size[k]);
    }
    if (*b->lost) return OK; /* of the companion nothing is used any more */
    if (b->solver.state.now.t != x->solver.state.now.t)
        return restored_none(x, "companion's time", b->solver.state.now.t);
    return restored_solver(x, &b->solver);
}

const ErrorBars BARS = {layout,         start, widen, begin_step, follow,
                        inputs_changed, turn,  get,   save,       restore, restored};

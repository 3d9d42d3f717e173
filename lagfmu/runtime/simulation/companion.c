/* companion.c -- a run beside the delivered one, at a coarser tolerance, for its error bars (bars.c). */
#include "companion.h"

#include <float.h>
#include <math.h>
#include <string.h>

#include "optional.h"
#include "step_size.h"

static double power(double x, int n) {
    double product = 1;
    for (int k = 0; k < n; k++) product *= x;
    return product;
}

double companion_alike(double coarser) {
    return 0.9 * step_size_root(coarser, 8);
}

static int is_alike(const Solver *s, const Integrator *i) {
    return i->method == OPTIONAL.methods[DOP853] && i->h_next > s->alike * (i->t - i->t_old);
}

/* The local error of the step just taken is counted; its estimate stays in y. */
static void add(const Solver *s, Integrator *i, LocalErrors *errors) {
    const int implicit = i->method != OPTIONAL.methods[DOP853];
    const double local = power((i->t - i->t_old) * s->state.now.rate, implicit ? 6 : 9);
    if (local <= DBL_MAX - errors->sum[implicit]) {
        errors->sum[implicit] += local;
        errors->most[implicit] = fmax(errors->most[implicit], local);
    }
    if (!is_alike(s, i)) return;
    for (int j = 0; j < i->ny; j++) i->y[j] += OPTIONAL.dop853_error(i, j);
}

void companion_after_step(Solver *s, Integrator *i) {
    s->state.now.local_old = s->state.now.local;
    add(s, i, &s->state.now.local);
}

void companion_at_trial(Solver *s, Integrator *i) {
    add(s, i, &s->local_trial);
}

void companion_at_event(Solver *s) {
    const LocalErrors *old = &s->state.now.local_old, *more = &s->local_trial;
    LocalErrors *local = &s->state.now.local;
    for (int k = 0; k < 2; k++) {
        local->sum[k] = fmin(old->sum[k] + more->sum[k], DBL_MAX);
        local->most[k] = fmax(old->most[k], more->most[k]);
    }
}

void companion_inside(const Solver *s, const Integrator *i, double t, double *y) {
    if (!is_alike(s, i)) return;
    for (int j = 0; j < i->ny; j++) y[j] += OPTIONAL.dop853_inside(i, t, j);
}

double companion_share(const Solver *a, const Solver *b, double margin, double few) {
    const LocalErrors *mine = &a->state.now.local, *others = &b->state.now.local;
    double ratio = HUGE_VAL, steps = HUGE_VAL;
    for (int k = 0; k < 2; k++) {
        if (mine->sum[k] > 0) ratio = fmin(ratio, others->sum[k] / mine->sum[k]);
        if (others->most[k] > 0) steps = fmin(steps, others->sum[k] / others->most[k]);
    }
    const double part = ratio < HUGE_VAL ? fmin(1, margin / ratio) : 1;
    return part * (1 + few / steps);
}

static int slides_paired(const Slide *a, const Slide *b) {
    const double turn = a->direction[0] * b->direction[0] + a->direction[1] * b->direction[1];
    return a->sticks == b->sticks && (a->sticks || (a->sign == b->sign && turn >= 0));
}

int companion_paired(const Solver *a, const Solver *b) {
    const System *s = a->system;
    const State *x = &a->state, *y = &b->state;
    int paired = 1;
    for (int k = 0; k < EVENT_KINDS; k++)
        for (int i = 0; i < event_count_of(s, (EventKind)k); i++)
            paired &= x->latest[k].count[i] == y->latest[k].count[i];
    for (int c = 0; c < s->contacts; c++) paired &= x->closed[c] == y->closed[c];
    for (int k = 0; k < s->jumps; k++) paired &= x->level[k] == y->level[k];
    for (int k = 0; k < s->frictions; k++)
        paired &= slides_paired(&x->slide[k], &y->slide[k]);
    return paired;
}

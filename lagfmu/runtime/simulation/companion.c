/* companion.c -- a run beside the delivered one, at a coarser tolerance, for its error bars (bars.c). */
#include "companion.h"

#include <float.h>
#include <math.h>

#include "parts.h"
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
    return i->method == PARTS.methods[DOP853] && i->h_next > s->alike * (i->t - i->t_old);
}

void companion_after_step(Solver *s, Integrator *i) {
    const int implicit = i->method != PARTS.methods[DOP853];
    const double local = power((i->t - i->t_old) * s->state.now.rate, implicit ? 6 : 9);
    if (local <= DBL_MAX - s->state.now.local[implicit]) s->state.now.local[implicit] += local;
    if (!is_alike(s, i)) return;
    for (int j = 0; j < i->ny; j++) i->y[j] += PARTS.dop853_error(i, j);
}

void companion_inside(const Solver *s, const Integrator *i, double t, double *y) {
    if (!is_alike(s, i)) return;
    for (int j = 0; j < i->ny; j++) y[j] += PARTS.dop853_inside(i, t, j);
}

double companion_ratio(const Solver *a, const Solver *b) {
    double least = HUGE_VAL;
    for (int k = 0; k < 2; k++) {
        const double mine = a->state.now.local[k], other = b->state.now.local[k];
        if (mine > 0) least = fmin(least, other / mine);
    }
    return least >= 1 && least < HUGE_VAL ? least : 1;
}

static int slides_paired(const Slide *a, const Slide *b) {
    const double turn = a->direction[0] * b->direction[0] + a->direction[1] * b->direction[1];
    return a->sticks == b->sticks && (a->sticks || (a->sign == b->sign && turn >= 0));
}

int companion_paired(const Solver *a, const Solver *b) {
    const System *s = a->system;
    const State *x = &a->state, *y = &b->state;
    int paired = x->now.strikes == y->now.strikes;
    for (int c = 0; c < s->contacts; c++)
        paired &= x->closed[c] == y->closed[c] && x->count[c] == y->count[c];
    for (int k = 0; k < s->jumps; k++) paired &= x->level[k] == y->level[k];
    for (int k = 0; k < s->frictions; k++)
        paired &= x->slip_count[k] == y->slip_count[k] && slides_paired(&x->slide[k], &y->slide[k]);
    return paired;
}

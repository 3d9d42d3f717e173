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

void companion_after_step(Solver *s, Integrator *i) {
    const double h = i->t - i->t_old, longer = 0.9 * step_size_root(s->coarser, 8);
    const int explicit_one = i->method == PARTS.methods[DOP853];
    const double local = power(h * s->state.now.rate, explicit_one ? 9 : 6);
    if (local <= DBL_MAX - s->state.now.local[!explicit_one])
        s->state.now.local[!explicit_one] += local;
    if (!explicit_one || !(s->coarser > 1 && i->h_next >= longer * h)) return;
    for (int j = 0; j < i->ny; j++) i->y[j] += PARTS.dop853_error(i, j);
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

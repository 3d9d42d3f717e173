/* companion.c -- a run beside the delivered one, at a coarser tolerance, for its error bars (bars.c). */
#include "companion.h"

#include <string.h>

#include "parts.h"
#include "step_size.h"

void companion_coarsen(const Solver *s, Integrator *i) {
    const double h = i->t - i->t_old, longer = 0.9 * step_size_root(s->coarser, 8);
    if (i->method != PARTS.methods[DOP853] || !(i->h_next >= longer * h)) return;
    for (int j = 0; j < i->ny; j++) i->y[j] += PARTS.dop853_error(i, j);
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

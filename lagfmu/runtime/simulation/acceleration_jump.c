/* acceleration_jump.c -- jumps of the accelerations that no event announces: the force of a spring whose length passes through
 * 0 turns round at an instant.
 *
 * A step goes over such a jump as the error control lets it, so short that the state is right; but its columns know
 * nothing of the jump, whose saltation (saltation.c) they lack.  Between the ends of a smooth step of length h the
 * accelerations change by about h times the natural rate.  Where they change by far more, the half of the step that
 * holds more of the change is halved again and again: a change that stays as large is a jump.  So is one within next
 * to no time, of which rounding leaves no derivative. */
#include "saltation.h"

#include <math.h>

#include "digits.h"
#include "nominals.h"
#include "segment.h"

static const double LIVELY = 10;     /* times h and the natural rate: how much accelerations may change */
static const double SLIGHT = 1e-6;   /* of an acceleration: a change that may be rounding */
enum { HALVINGS = 6 };
static const double PERSISTS = 0.5;     /* of a change, that is left in a part 2^-HALVINGS of the step */
static const double NO_TIME = 1e-10; /* natural times */

/* vdot[k] at the part a of the step, between its ends by cubic polynomials with the rates f0 and f1. */
static Status acceleration_within(Solver *s, const Integrator *i, const double *f1, double a, int k, double *value) {
    const int nq = s->system->nq;
    const double b = 1 - a, h = i->t - i->t_old;
    double *y = s->part.columns->there;
    for (int j = 0; j < system_states(s->system); j++)
        y[j] = b * b * ((1 + 2 * a) * i->y_old[j] + a * h * i->f_old[j]) +
               a * a * ((1 + 2 * b) * i->y[j] - b * h * f1[j]);
    if (segment_motion(s, segment_instant(s, i->t_old + a * h), y, y + nq) != OK) return FAILED;
    *value = s->stepped.vdot[k];
    return OK;
}

/* The speed whose rate changes most from f0 to f1, in units of what a smooth step can do; -1: none by more. */
static int liveliest(const Solver *s, double h, const double *f0, const double *f1) {
    const int nq = s->system->nq;
    const double rate = s->state.now.rate, smooth = fmax(LIVELY * h * rate, SLIGHT);
    double most = smooth;
    int found = -1;
    for (int k = 0; k < s->system->nv; k++) {
        const double natural = rate * nominals_natural(s, nq + k);
        const double size = fmax(natural, fmax(fabs(f0[nq + k]), fabs(f1[nq + k])));
        const double change = fabs(f1[nq + k] - f0[nq + k]) / size;
        if (change > most) {
            most = change;
            found = k;
        }
    }
    return found;
}

void acceleration_jump_look(Solver *s) {
    const Integrator *i = &s->integrator;
    const Method *method = i->method;
    const int nq = s->system->nq;
    const double h = i->t - i->t_old;
    if (!*s->state.varied || s->state.now.approach.near || s->state.now.event_count > 0) return;
    const double *f1 = i->dense + (method->last_stage + 1) * i->ny;
    if (method->last_stage == 0) {
        double *rates = s->part.columns->change;
        if (segment_motion(s, segment_instant(s, i->t), i->y, i->y + nq) != OK) return;
        mechanism_rates(&s->stepped, i->y + nq, rates);
        for (int k = 0; k < s->system->nv; k++) rates[nq + k] = s->stepped.vdot[k];
        f1 = rates;
    }
    const int k = liveliest(s, h, i->f_old, f1);
    if (k < 0) return;
    double first = 0, last = 1, low = i->f_old[nq + k], high = f1[nq + k], middle;
    const double change = fabs(high - low);
    for (int count = 0; count < HALVINGS && h * s->state.now.rate > NO_TIME; count++) {
        const double a = (first + last) / 2;
        if (acceleration_within(s, i, f1, a, k, &middle) != OK) return;
        const int later = fabs(high - middle) > fabs(middle - low);
        *(later ? &first : &last) = a;
        *(later ? &low : &high) = middle;
        if (!(fabs(high - low) > PERSISTS * change)) return;
    }
    const StateName of = system_acceleration_name(s->system, k);
    (void)fail(&s->why,
               "%s%s%s jumps from %.6g to %.6g at t = %s s, where nothing is watched: a length that the forces "
               "depend on, or the like, passes through 0",
               of.head, of.name, of.tail, low, high, digits(i->t_old + first * h).text);
    saltation_end(s);
}

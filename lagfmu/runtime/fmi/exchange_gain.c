/* exchange_gain.c -- how quickly drift is led back onto the constraints (Model Exchange).
 *
 *   alpha = 3 min(natural rate, max(rho, |dG/dt| / |G|, sqrt(|vdot|/size)))   [1/s]
 *
 * The natural rate (nominals.c) says how small a time may matter where nothing tells what is large: of a belt
 * at 0.2 m/s under g it is 2 g / (0.2 m/s), 98 1/s, though nothing there is quicker than its spring.  So it is
 * bounded by what the motion does: rho, the largest |eigenvalue| of its own linearization
 *
 *   d/dt (dq, dv) = (dv, dvdot(q, v; dq, dv))      (without stabilization)
 *
 * by the power method (Golub & Van Loan, Matrix Computations, sect. 7.3), its products by differences; by the
 * rates at which rows turn (of a knife edge, whose rho is 0); and by the accelerations of coordinates whose size
 * a parameter tells (at a turning point both are 0).  Drift dies like exp(-alpha t), at most three times as
 * quickly as the motion itself changes: nothing becomes stiff. */
#include "exchange.h"

#include <math.h>
#include <string.h>

#include "nominals.h"
#include "numbers.h"
#include "segment.h"

static const double GAIN = 3; /* in units of the motion's own rate */
enum { ROUNDS = 24, GAIN_SETTLED = 8 }; /* products, and how many of them only turn the vector */
static const double PART = 0x1p-20; /* of the coordinates' sizes: how far they are displaced */

/* The state that is displaced: sizes and direction (states), in which direction[j] = 1 is one size. */
typedef struct {
    Solver *s;
    double *work; /* (2 states) */
    double *size, *direction, *rate; /* rate (states): where nothing is displaced */
} Tried;

static Status move(Solver *s, double *rate) {
    s->stepped.stage = 1;
    const Status status = segment_motion(s, segment_instant(s, s->state.now.t), s->state.q, s->state.v);
    s->stepped.stage = 0;
    mechanism_rates(&s->stepped, s->state.v, rate);
    memcpy(rate + s->system->nq, s->stepped.vdot, (size_t)s->system->nv * sizeof *rate);
    return status;
}

/* direction <- the linearization's product with it, and its length after one that was 1; 0 if it vanishes. */
static Status multiply(const Tried *x, double *length) {
    Solver *s = x->s;
    const int nq = s->system->nq, nv = s->system->nv;
    double *y = x->work, *rate = y + nq + nv;
    state_gather(s->system, s->state.q, s->state.v, y);
    for (int j = 0; j < nq; j++) s->state.q[j] += PART * x->size[j] * x->direction[j];
    for (int i = 0; i < nv; i++) s->state.v[i] += PART * x->size[nq + i] * x->direction[nq + i];
    const Status status = move(s, rate);
    state_scatter(s->system, y, s->state.q, s->state.v);
    if (status != OK) return FAILED;
    for (int j = 0; j < nq && s->system->kinematics == NULL; j++)
        x->direction[j] = x->size[nq + j] / x->size[j] * x->direction[nq + j];
    for (int j = s->system->kinematics == NULL ? nq : 0; j < nq + nv; j++)
        x->direction[j] = (rate[j] - x->rate[j]) / (PART * x->size[j]);
    *length = largest(nq + nv, x->direction);
    for (int j = 0; j < nq + nv && *length > 0; j++) x->direction[j] /= *length;
    return OK;
}

/* rho; infinite where the motion is not defined beside the state. */
static double own_rate(const Tried *x) {
    double logarithm = 0, length;
    for (int j = 0; j < system_states(x->s->system); j++) x->direction[j] = 1 - 1.618 * (j % 2) + 1 / (1.0 + j);
    for (int round = 0; round < ROUNDS; round++) {
        if (multiply(x, &length) != OK) return HUGE_VAL;
        if (!(length > 0)) return 0;
        if (round >= GAIN_SETTLED) logarithm += log(length);
    }
    return exp(logarithm / (ROUNDS - GAIN_SETTLED));
}

/* The largest rate that an acceleration gives to what has a size that a row tells; an angle's is 1 rad. */
static double sized_rate(const Tried *x, const double *vdot) {
    const Solver *s = x->s;
    const System *system = s->system;
    double *least = x->work, rate = 0;
    nominals_extents(system, s->p, least);
    for (int i = 0; i < system->nv; i++) {
        const double own = mechanism_reach(&s->stepped, least, i);
        const double size = system->speed_dimension[i] == system->angles ? 1 : own;
        if (size > 0) rate = fmax(rate, sqrt(fabs(vdot[i]) / size));
    }
    return rate;
}

/* The largest rate at which a row turns as the motion goes on, what moves being measured by its span (nv). */
static double turning_rate(const Tried *x, const double *span) {
    Solver *s = x->s;
    const System *system = s->system;
    Mechanism *b = &s->stepped;
    double *G = s->sensitivity.dG, *q = x->work, rate = 0;
    const double ahead = PART / s->state.now.rate;
    const Instant at = segment_instant(s, s->state.now.t);
    memcpy(G, b->G, (size_t)system->entries * sizeof *G);
    mechanism_rates(b, s->state.v, q);
    for (int j = 0; j < system->nq; j++) q[j] = s->state.q[j] + ahead * q[j];
    if (mechanism_evaluate(b, at, q, s->state.v) != OK) return 0;
    for (int k = 0; k < system->m; k++) {
        double turned = 0;
        for (int e = system->row_start[k]; e < system->row_start[k + 1]; e++)
            turned += fabs(b->G[e] - G[e]) * span[system->entry_column[e]];
        const double whole = mechanism_row_size(b, k, span);
        if (whole > 0) rate = fmax(rate, turned / (ahead * whole));
    }
    return rate;
}

Status exchange_find_gain(Instance *x) {
    Solver *s = &x->solver;
    const int nq = s->system->nq, nv = s->system->nv;
    const double natural = s->state.now.rate;
    double *size = x->work + 2 * (nq + nv);
    const Tried tried = {s, x->work, size, size + nq + nv, size + 2 * (nq + nv)};
    x->gain = 0;
    if (s->system->m == 0 || x->dae) return OK;
    segment_begin(s);
    if (move(s, tried.rate) != OK) return FAILED;
    for (int j = 0; j < nq; j++) size[j] = s->state.size[j] > 0 ? s->state.size[j] : 1;
    for (int i = 0; i < nv; i++) {
        const double span = s->state.span[i] > 0 ? s->state.span[i] : 1;
        size[nq + i] = span * natural;
        tried.direction[i] = span;
    }
    const double turning = turning_rate(&tried, tried.direction); /* of the G that was evaluated last */
    x->gain = GAIN * fmin(natural, fmax(turning, fmax(own_rate(&tried), sized_rate(&tried, tried.rate + nq))));
    return OK;
}

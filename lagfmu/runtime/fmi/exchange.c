/* exchange.c -- an instance whose state is moved by an importer's integrator (Model Exchange).
 *
 * An importer's integrator knows no constraints: f = 0 and G v = nu, differentiated twice, drift away
 * (Hairer & Wanner II, sect. VII.2).  The accelerations that it gets are therefore stabilized,
 *
 *   G vdot = gamma - 2 alpha (G v - nu) - alpha^2 f           G vdot = gamma - alpha (G v - nu)
 *
 * (Baumgarte 1972; the second where there is no f), with alpha of the order of the motion's own rate
 * (exchange_gain.c), so that nothing becomes stiff and the drift stays in proportion to the importer's
 * tolerance, whatever that is.  lambda, as it is read, is that of the unstabilized equations.  Where this does
 * not hold the drift (constraints that depend on each other) an event does (exchange_events.c).  Projection
 * alone would cost a restart of the importer's integrator each time. */
#include "exchange.h"

#include <math.h>
#include <string.h>

#include "indicators.h"
#include "nominals.h"
#include "optional.h"
#include "schur.h"
#include "segment.h"

void exchange_begin(Instance *x) {
    memset(x->set, 0, (size_t)x->solver.system->inputs * sizeof *x->set);
}

void exchange_set_time(Instance *x, double t) {
    Solver *s = &x->solver;
    const System *system = s->system;
    if (s->state.now.t != t) x->observed = x->evaluated = 0;
    if (system->prescribed_count > 0) drive_at(system, &s->drive, t, x->expected);
    for (int i = 0; i < system->prescribed_count; i++) { /* what the importer drives it sets at each time */
        const int k = system->prescribed[i];
        if (x->set[k] || x->set[k + 1] || x->set[k + 2]) continue;
        memcpy(s->drive.value + k, x->expected + k, 3 * sizeof *x->expected);
    }
    s->state.now.t = s->drive.since = t;
}

/* Where an importer has y[j]: each coordinate with its rate, or first all coordinates and then the speeds. */
static int place_of(const System *s, int j) {
    if (s->kinematics != NULL) return j;
    return j < s->nq ? 2 * j : 2 * (j - s->nq) + 1;
}

Status exchange_get_states(Instance *x, double *states) {
    const Solver *s = &x->solver;
    const int nq = s->system->nq, nv = s->system->nv;
    if (instance_start(x) != OK) return FAILED;
    for (int j = 0; j < nq; j++) states[place_of(s->system, j)] = s->state.q[j];
    for (int i = 0; i < nv; i++) states[place_of(s->system, nq + i)] = s->state.v[i];
    if (EXCHANGE_LOST) states[nq + nv] = s->state.now.lost;
    return OK;
}

Status exchange_set_states(Instance *x, const double *states) {
    Solver *s = &x->solver;
    const int nq = s->system->nq, nv = s->system->nv;
    if (EXCHANGE_LOST) s->state.now.lost = states[nq + nv];
    for (int j = 0; j < nq; j++) s->state.q[j] = states[place_of(s->system, j)];
    for (int i = 0; i < nv; i++) s->state.v[i] = states[place_of(s->system, nq + i)];
    x->observed = x->evaluated = 0;
    return instance_settle_states(x);
}

/* Kinetic energy [J] of what moves through its size at the natural rate. */
static double nominal_energy(const Solver *s) {
    const System *system = s->system;
    double energy = 0;
    for (int e = 0; e < system->masses; e++) {
        const int j = system->mass_row[e];
        const double speed = fmax(s->state.span[j] * s->state.now.rate, fabs(s->state.v[j]));
        if (system->mass_column[e] == j) energy += s->stepped.M[e] * speed * speed / 2;
    }
    return energy;
}

Status exchange_nominals(Instance *x, double *nominals) {
    const System *system = x->solver.system;
    const int states = system_states(system);
    if (instance_start(x) != OK) return FAILED;
    double *still = x->solver.work_advance, *scale = still + states;
    memset(still, 0, (size_t)states * sizeof *still);
    nominals_shared(&x->solver, still, scale);
    for (int j = 0; j < states; j++) nominals[place_of(system, j)] = scale[j];
    if (EXCHANGE_LOST) nominals[states] = nominal_energy(&x->solver);
    for (int j = 0; j < states + EXCHANGE_LOST; j++)
        if (!(nominals[j] > 0)) nominals[j] = 1;
    return OK;
}

/* Accelerations and multipliers at the state. */
Status exchange_evaluate(Instance *x) {
    Solver *s = &x->solver;
    if (x->evaluated) return OK;
    if (instance_start(x) != OK) return FAILED;
    if (x->gain < 0 && exchange_find_gain(x) != OK) return FAILED;
    segment_begin(s);
    if (segment_motion(s, segment_instant(s, s->state.now.t), s->state.q, s->state.v) != OK) return FAILED;
    x->evaluated = 1;
    return OK;
}

/* The multipliers of all rows, those too that depend on others. */
Status exchange_multipliers(Instance *x) {
    Solver *s = &x->solver;
    if (x->exchange && !s->state.now.dependent) return exchange_evaluate(x);
    if (instance_start(x) != OK) return FAILED;
    segment_begin(s);
    x->evaluated = 0;
    return segment_motion_near(s, segment_instant(s, s->state.now.t), s->state.q, s->state.v);
}

/* Adds the accelerations that lead back onto the constraints. */
static Status stabilize(Instance *x, double *derivatives) {
    Solver *s = &x->solver;
    Mechanism *b = &s->stepped;
    const double alpha = x->gain;
    double *c = s->sensitivity.c, *a = s->sensitivity.dvdot;
    if (!(alpha > 0)) return OK;
    if (mechanism_residual(b, segment_instant(s, s->state.now.t), s->state.q, b->f) != OK)
        return FAILED;
    for (int k = 0; k < s->system->m; k++)
        c[k] = s->system->rows[k].kind == NONHOLONOMIC
                   ? -alpha * mechanism_slip(b, k, s->state.v)
                   : -alpha * (2 * mechanism_slip(b, k, s->state.v) + alpha * (b->f[k] - s->state.offset[k]));
    if (linear_nearest(&b->linear, NULL, c, a, NULL) != OK) return OK; /* rows contradict each other */
    for (int i = 0; i < s->system->nv; i++) derivatives[place_of(s->system, s->system->nq + i)] += a[i];
    return OK;
}

Status exchange_derivatives(Instance *x, double *derivatives) {
    Solver *s = &x->solver;
    Mechanism *b = &s->stepped;
    const System *system = s->system;
    double *rate = s->work_advance;
    if (exchange_evaluate(x) != OK) return FAILED;
    mechanism_rates(b, s->state.v, rate);
    for (int j = 0; j < system->nq; j++) derivatives[place_of(system, j)] = rate[j];
    for (int i = 0; i < system->nv; i++) derivatives[place_of(system, system->nq + i)] = b->vdot[i];
    if (EXCHANGE_LOST) derivatives[system_states(system)] = OPTIONAL.friction->power(s);
    return stabilize(x, derivatives);
}

Status exchange_indicators(Instance *x, double *indicators) {
    Solver *s = &x->solver;
    Mechanism *b = &s->stepped;
    const System *system = s->system;
    if (indicators_count(system) == 0) return OK;
    if (exchange_multipliers(x) != OK) return FAILED;
    const Instant at = segment_instant(s, s->state.now.t);
    if (mechanism_residual(b, at, s->state.q, b->f) != OK) return FAILED;
    if (system->switches > 0)
        system->surfaces(at.t, s->state.q, at.u, at.p, indicators + system->contacts);
    for (int k = 0; k < system->switches; k++) /* of a floor: how far to the next whole number */
        if (system->at_integers[k])
            indicators[system->contacts + k] =
                range_inside(OPTIONAL.switches->range(s, k), indicators[system->contacts + k]);
    if (system->frictions > 0) {
        const int first = indicators_first_of_frictions(system);
        OPTIONAL.friction->indicators(s, indicators + first);
        for (int i = 0; i < 2 * system->frictions; i++)
            indicators[first + i] += indicators_range(s, first + i).slack;
    }
    for (int c = 0; c < s->system->contacts; c++) {
        const int k = s->system->contact[c];
        indicators[c] = s->state.closed[c] ? b->lambda[k] : b->f[k] + s->state.gap[c];
    }
    return OK;
}

/* inverse.c -- inverse dynamics: where constraints and prescribed motions leave no freedom nothing is integrated.
 *
 *   f(q, t) = offset  holds as many independent rows as there are speeds, and says where q is,  G v = nu  what v is
 *
 * (Nikravesh, Computer-Aided Analysis of Mechanical Systems, sect. 3.1: kinematic analysis), by the projection of
 * project.c from a prediction; vdot and lambda follow from one solve there.  So a point has no error of the steps that
 * led to it.  The step is the whole way to the bound, unless the cubic through (y, y') at both ends misses f = offset
 * in between: by more than BRANCH of the coordinates it may be another branch that was reached; where something looks at
 * the cubic, for an event or an extreme, the tolerance says how much that may be. */
#include <math.h>
#include <string.h>

#include "feature.h"
#include "indicators.h"
#include "nominals.h"
#include "optional.h"
#include "segment.h"
#include "square.h"
#include "step_size.h"

static const double HELD_AGAINST = 0.382; /* of the step: where the cubic is held against f; in its middle a motion of the
                                           * step's period is on it */
static const double BRANCH = 1e-3;        /* of the coordinates */
static const double LED_ROUNDING = 0x1p-48; /* of a coordinate: no miss */
static const double CROSSED = 1e-9;       /* of the coordinates, where the determinant changes its sign: branches that only
                                           * come near each other lie that far apart, or are taken for one that crosses */
static const double NARROWED = 0.1;       /* angle [rad] of rows: as where a passage is looked for; no sign tells of it */
static const double LOOKED_AT = 0.1;      /* times tolerance^(2/3), as radau, whose dense output serves to search, too */
static const double TURNS = 0.1;          /* [rad] of a step, and parts of sizes, by which rows turn little */
static const double WATCHED = 1;          /* [rad] of a step in which something is looked at */
static const double FOLLOWED = 2;         /* steps before, so far the cubic is followed beyond it */
static const double INVERSE_SAFE = 0.9, INVERSE_LEAST = 0.2, INVERSE_MOST = 5; /* of the step's change */
enum { APPROACHES = 3 };                  /* simplified Newton steps before the projection, at most */

/* y (n) <- the cubic through (y, f) at t = 0 and 1, f times the step, at t. */
static void led_cubic(int n, const double *y0, const double *f0, const double *y1, const double *f1, double h, double t,
                  double *y) {
    const double left = 1 - t;
    for (int j = 0; j < n; j++) {
        const double change = y1[j] - y0[j];
        y[j] = y0[j] + t * (change + left * (left * (h * f0[j] - change) - t * (h * f1[j] - change)));
    }
}

/* y at t: by the cubic of the step before, or by the accelerations. */
static void foresee(Solver *s, const Integrator *i, double t, double *y) {
    const int nq = s->system->nq, nv = s->system->nv;
    const double h = t - i->t, before = i->t - i->t_old;
    double *rate = i->scratch + 2 * i->ny;
    if (before > 0 && h <= FOLLOWED * before) {
        led_cubic(i->ny, i->y_old, i->f_old, i->y, i->f, before, 1 + h / before, y);
        return;
    }
    for (int j = 0; j < nv; j++) y[nq + j] = i->y[nq + j] + h / 2 * i->f[nq + j];
    for (int j = 0; j < nq; j++) y[j] = i->y[j] + h / 2 * i->f[j];
    mechanism_kinematics(&s->stepped, segment_instant(s, i->t + h / 2), y);
    mechanism_rates(&s->stepped, y + nq, rate);
    for (int j = 0; j < nq; j++) y[j] = i->y[j] + h * rate[j];
    for (int j = 0; j < nv; j++) y[nq + j] += h / 2 * i->f[nq + j];
}

/* b->dq: by how much q misses f = offset at an instant, along the speeds, by the rows that were factored last. */
static Status find_way(Solver *s, Instant at, double *q) {
    Mechanism *b = &s->stepped;
    if (mechanism_settle(b, at, q) != OK || mechanism_residual(b, at, q, b->f) != OK) return FAILED;
    for (int k = 0; k < s->system->m; k++) b->f[k] = s->state.offset[k] - b->f[k];
    return linear_nearest(&b->linear, NULL, b->f, b->dq, NULL);
}

/* y nearer to f = offset by simplified Newton steps, as long as they get shorter: the projection then finds it there. */
static void approach(Solver *s, double t, double *y) {
    Mechanism *b = &s->stepped;
    const int nq = s->system->nq;
    const Instant at = segment_instant(s, t);
    double before = HUGE_VAL;
    if (mechanism_evaluate(b, at, y, y + nq) != OK || linear_factor(&b->linear, b->M, b->G, solver_rows(s)) != OK) return;
    for (int count = 0; count < APPROACHES; count++) {
        double length = 0;
        if (find_way(s, at, y) != OK) return;
        for (int i = 0; i < s->system->nv; i++) length = fmax(length, fabs(b->dq[i]));
        if (!(length < before / 2)) return;
        mechanism_move(b, 1, b->dq, y);
        before = length;
    }
}

/* What a coordinate's miss is held against, however far the motion has led: of angles 1 rad, of others the largest
 * parameter in their rows, or in those of others of their dimension; where no row tells one, the largest coordinate. */
static double led_size(const Solver *s, const double *extent, const double *q, int j) {
    const System *system = s->system;
    double told = 0, most = 0;
    if (system->dimension[j] == system->angles) return 1;
    if (extent[j] > 0) return extent[j];
    for (int k = 0; k < system->nq; k++) {
        if (system->dimension[k] != system->dimension[j]) continue;
        told = fmax(told, extent[k]);
        most = fmax(most, fmax(fabs(q[k]), s->state.size[k]));
    }
    return told > 0 ? told : most;
}

/* By how much the cubic from i to (t, y), whose q' is in `rate`, misses f = offset, of the coordinates. */
static Status find_miss(Solver *s, const Integrator *i, double t, const double *y, const double *rate, double *miss) {
    Mechanism *b = &s->stepped;
    const int nq = s->system->nq;
    double *q = i->scratch + 2 * i->ny, *on = q + nq, *extent = on + nq;
    const double h = t - i->t;
    const Instant at = segment_instant(s, i->t + HELD_AGAINST * h);
    led_cubic(nq, i->y, i->f, y, rate, h, HELD_AGAINST, q);
    if (find_way(s, at, q) != OK) return FAILED;
    memcpy(on, q, (size_t)nq * sizeof *q);
    mechanism_move(b, 1, b->dq, on);
    nominals_extents(s->system, s->p, extent);
    *miss = 0;
    for (int j = 0; j < nq; j++) {
        const double off = fabs(on[j] - q[j]);
        if (off > LED_ROUNDING * fabs(q[j])) *miss = fmax(*miss, off / led_size(s, extent, q, j));
    }
    return OK;
}

/* y on the constraints at the end of the trial; by how much the cubic misses them on the way. */
static Status arrive_at(Solver *s, const Integrator *i, double t, double *y, double *miss) {
    double *rate = i->scratch + i->ny;
    foresee(s, i, t, y);
    approach(s, t, y);
    if (segment_project(s, t, y) != OK) return FAILED;
    mechanism_rates(&s->stepped, y + s->system->nq, rate);
    s->stages.narrowest = fmin(s->stages.narrowest, s->stages.apart = linear_apart(&s->stepped.linear));
    return find_miss(s, i, t, y, rate, miss);
}

/* Where the rows are as many as the speeds a crossing of branches within the step shows by the sign of their
 * determinant.  error_old remembers that of where a step begins: 1 for -1, 2 for 1, 0: not known. */
static double sign_there(Solver *s) {
    const Square *square = s->system->square;
    const int sign = square == NULL ? 0 : square->sign(&s->stepped.linear);
    return sign == 0 ? 0 : sign < 0 ? 1 : 2;
}

/* Otherwise rows tell by which it is narrow at an end of the step, if they turn little on the way: so long. */
static double longest_turn(const Solver *s, const Integrator *i) {
    const System *system = s->system;
    double rate = 0;
    if (system->square != NULL || OPTIONAL.passage == NULL) return HUGE_VAL;
    for (int j = 0; j < system->nv; j++) {
        const double unit = system->speed_dimension[j] == system->angles ? 1 : s->state.span[j];
        if (unit > 0) rate = fmax(rate, fabs(i->y[system->nq + j]) / unit);
    }
    return rate > 0 ? TURNS / rate : HUGE_VAL;
}

/* What is looked at may go round with an angle that the cubic follows over any number of turns: steps to take at least. */
static double turns_taken(const Solver *s, const Integrator *i, const double *y) {
    const System *system = s->system;
    double most = 0;
    for (int j = 0; j < system->nq; j++)
        if (system->dimension[j] == system->angles) most = fmax(most, fabs(y[j] - i->y[j]) / WATCHED);
    return most;
}

static int is_watched(const Solver *s) {
    return indicators_count(s->system) > 0 || features_everywhere(s) || s->state.now.approach.near;
}

static double allowed_miss(const Solver *s) {
    const double tolerance = s->settings.tolerance;
    return is_watched(s) ? LOOKED_AT * step_size_root(tolerance * tolerance, 3) : BRANCH;
}

static Status inverse_step(Integrator *i, const Ode *ode, const Control *control, double t_bound) {
    Solver *s = ode->context;
    const double allowed = allowed_miss(s);
    double *y = i->scratch, factor = INVERSE_MOST, sign = 0;
    int crossed = 0;
    const int narrowed = s->system->square == NULL && OPTIONAL.passage != NULL;
    Trial trial;
    t_bound = fmin(t_bound, i->t + longest_turn(s, i));
    if (!(i->h_next > 0)) i->h_next = t_bound - i->t;
    if (trial_begin(&trial, i, ode, control, t_bound, 3) != OK) return FAILED;
    for (;;) {
        double miss = HUGE_VAL, most = allowed;
        trial.unevaluated = arrive_at(s, i, trial.t_new, y, &miss) != OK;
        sign = trial.unevaluated ? 0 : sign_there(s);
        crossed = i->error_old > 0 && sign > 0 && sign != i->error_old;
        if (crossed || (narrowed && s->stages.apart < NARROWED)) most = fmin(most, CROSSED);
        if (miss > 0) factor = fmin(fmax(INVERSE_SAFE * step_size_root(fmin(most / miss, 1e4), 4), INVERSE_LEAST), INVERSE_MOST);
        const double turns = miss <= most && is_watched(s) ? turns_taken(s, i, y) : 0;
        if (turns > 1) factor = fmin(factor, INVERSE_SAFE / turns);
        else if (miss <= most) break;
        if (trial_reject(&trial, i, ode, fmin(factor, INVERSE_SAFE)) != OK) return FAILED;
    }
    if (crossed) s->stages.narrowest = 0;
    i->error_old = sign;
    trial_accept(&trial, i, y, factor);
    i->error = 0;
    return OK;
}

static void inverse_begin(Integrator *i, void *of) { i->error_old = sign_there(of); }

static Status inverse_prepare(Integrator *i, const Ode *ode) { return step_size_rate(i, ode); }

static void inverse_dense(const Integrator *i, double t, double *y) {
    const double h = i->t - i->t_old;
    led_cubic(i->ny, i->y_old, i->f_old, i->y, i->f, h, (t - i->t_old) / h, y);
}

int inverse_dynamics_applies(const Solver *s) {
    const System *system = s->system;
    const int *rows = solver_rows(s);
    int held = 0;
    for (int k = 0; k < system->m; k++) {
        if (system->rows[k].kind != HOLONOMIC || system->rows[k].while_closed >= 0) return 0;
        held += rows[k];
    }
    return system->m > 0 && held == system->nv && system->frictions == 0 &&
           system->nq == system->nv + system->quaternions + system->unwrapped_count;
}

SHARED_VALUE const Method inverse_dynamics = {
    .name = "inverse dynamics",
    .scratch_arrays = 5, /* y; its rate; three of coordinates, or a rate */
    .coarse = 1,
    .exact = 1,
    .step = inverse_step,
    .begin = inverse_begin,
    .prepare_dense = inverse_prepare,
    .dense = inverse_dense,
};

/* segment.c -- the index-1 equations of motion as an ordinary differential equation, and its projection
 * (Hairer & Wanner II, sect. VII.2: index reduction with projection). */
#include "segment.h"

#include <float.h>
#include <math.h>
#include <string.h>

#include "nominals.h"
#include "optional.h"
#include "refused_step.h"
#include "sensitivity.h"
#include "step_size.h"

static const double FAR = 1e3, LEAST_FAR = 1e-6; /* how far a projection may move the state: times the
                                                  * tolerance, and at least, relative to the state */
static const double BALANCED = 1e3 * DBL_EPSILON; /* of what the forces alone would make of a step: what they
                                                   * leave of it where others hold the state still */
static const double HOPELESS = 1.0; /* error of one rk4 step, relative to the state: it means nothing */
static const double KEPT_APART = 0.01; /* angle [rad] of the rows of a step below which others may stand for all better */
static const double PASSING = 1e-10; /* least tolerance of a step next to a singular configuration */
static const double TOLERANCE_SHARE = 0.25; /* of the tolerance: errors of many steps add up */

/* Which rows depend on each other.  Those that stick by friction are others from one instant to the next. */
static void tell_of_rows(Solver *s) {
    s->stepped.dependent = s->state.now.dependent;
    s->stepped.basis = s->state.now.dependent && s->system->frictions == 0 ? s->state.basis : NULL;
}

void segment_begin(Solver *s) {
    system_active(s->system, s->state.closed, s->active);
    tell_of_rows(s);
}

void segment_choose_rows(Solver *s) {
    s->state.now.dependent = linear_basis(&s->stepped.linear, s->state.basis);
    tell_of_rows(s);
}

void segment_inputs(const Solver *s, double t, double *u) {
    if (s->system->inputs == 0) return;
    drive_at(s->system, &s->drive, t, u);
    if (s->caller.supply != NULL) s->caller.supply(s->caller.own, t, u);
}

Instant segment_instant(Solver *s, double t) {
    const System *system = s->system;
    segment_inputs(s, t, s->u);
    for (int k = 0; k < system->switches; k++) s->u[system->inputs + k] = s->state.switch_state[k];
    return (Instant){t, s->u, s->p};
}

Status segment_motion_near(Solver *s, Instant at, const double *q, const double *v) {
    return mechanism_motion_near(&s->stepped, at, q, v, s->active, s->state.offset, s->state.span);
}

Status segment_motion(Solver *s, Instant at, const double *q, const double *v) {
    return s->system->frictions > 0 ? segment_motion_near(s, at, q, v)
                                    : mechanism_motion(&s->stepped, at, q, v, solver_rows(s));
}

/* q' of the latest evaluation; quicker than memcpy for a few coordinates. */
static inline void find_rates(const Solver *s, const double *y, double *dydt) {
    const int nq = s->system->nq;
    if (s->system->kinematics != NULL)
        KINEMATICS->rates(&s->stepped, y + nq, dydt);
    else
        for (int j = 0; j < nq; j++) dydt[j] = y[nq + j];
}

static Status rate_of_state(void *context, double t, const double *y, double *dydt) {
    Solver *s = context;
    const int nq = s->system->nq, nv = s->system->nv;
    if (s->state.now.approach.near && (y = OPTIONAL.passage->stage(s, t, y)) == NULL) return FAILED;
    s->stepped.stage = 1;
    Status status = segment_motion(s, segment_instant(s, t), y, y + nq);
    if (status == OK && s->columns > 0) OPTIONAL.variation->rates(s, t, y, dydt + nq + nv);
    s->stepped.stage = 0;
    if (status != OK) return FAILED;
    if (OPTIONAL.passage != NULL) s->stages.narrowest = fmin(s->stages.narrowest, s->stages.apart = linear_apart(&s->stepped.linear));
    find_rates(s, y, dydt);
    for (int i = 0; i < nv; i++) dydt[nq + i] = s->stepped.vdot[i];
    return OK;
}

/* The same where every row acts and is solved by code written out: nine in ten of all evaluations. */
static Status plain_rate(void *context, double t, const double *y, double *dydt) {
    Solver *s = context;
    const int nq = s->system->nq;
    if (!s->system->accelerate(t, y, y + nq, s->u, s->p, dydt + nq)) return rate_of_state(context, t, y, dydt);
    s->stages.apart = 1;
    mechanism_kinematics(&s->stepped, (Instant){t, s->u, s->p}, y);
    find_rates(s, y, dydt);
    return OK;
}

static int is_plain(const Solver *s) {
    const int *rows = solver_rows(s);
    if (s->system->accelerate == NULL || s->system->frictions > 0 || s->columns > 0) return 0;
    for (int k = 0; k < s->system->m; k++)
        if (!rows[k]) return 0;
    return 1;
}

static Status jacobian(void *context, double t, const double *y, double *J, double *dfdt) {
    Solver *s = context;
    if (s->system->frictions > 0) return OPTIONAL.friction->jacobian(s, t, y, J, dfdt);
    return sensitivity_jacobian(&s->sensitivity, &s->stepped, segment_instant(s, t), solver_rows(s), y, J,
                                dfdt);
}

/* The equations at the times of a step from t on. */
static Ode equations_at(Solver *s, double t) {
    const int plain = is_plain(s) && !s->state.now.approach.near;
    if (plain) (void)segment_instant(s, t); /* switch states, which stay */
    return (Ode){s, plain ? plain_rate : rate_of_state, jacobian, &s->why, NULL};
}

double segment_fewest_steps(const Solver *s) {
    return OPTIONAL.methods[s->settings.method]->fewest_steps;
}

double segment_natural_step(const Solver *s) {
    return 1 / (segment_fewest_steps(s) * s->state.now.rate);
}

double segment_tolerance(const Solver *s) {
    return fmax(s->settings.tolerance, s->state.now.approach.near ? PASSING : 0);
}

static Control control(const Solver *s, const Integrator *i, double longest) {
    const Settings *set = &s->settings;
    const double fixed = set->step > 0 ? set->step : segment_natural_step(s);
    if (s->limit > 0) longest = fmin(longest, s->limit);
    if (s->state.now.approach.near) longest = fmin(longest, OPTIONAL.passage->longest(s, i->h_next));
    if (set->maximum_step > 0) longest = fmin(longest, set->maximum_step);
    if (!s->integrator.method->fixed && !s->integrator.method->exact) nominals_shared(s, i->y, s->scale);
    return (Control){TOLERANCE_SHARE * segment_tolerance(s), s->scale, longest < HUGE_VAL ? longest : 0,
                     fixed};
}

/* Of a method that controls no error a step whose error is as large as the state itself is refused. */
static Status check_fixed_step(Solver *s, const Integrator *i) {
    for (int j = 0; j < system_states(s->system); j++) {
        const double size = nominals_natural(s, j);
        if (!(fabs(i->method->error(i, j)) <= HOPELESS * fmax(fabs(i->y[j]), size)))
            return refused_fixed_step(&s->why, i->t_old, i->method->name, i->t - i->t_old);
    }
    return OK;
}

/* The accelerations at the state on the constraints where a step begins: by all rows, of which those that
 * depend on others are then left out in the step's stages, which lie off the constraints; they are chosen anew
 * where those of the step before do no longer.  Where nothing is integrated they may have been shown. */
static Status accept(Solver *s, Integrator *i) {
    const int nq = s->system->nq, nv = s->system->nv;
    const int stale = i->method->exact && s->state.now.approach.near; /* look() sees where the step begins */
    if (i != &s->integrator || (!i->fresh && !stale) || s->system->m < 2) return OK;
    const double *y = i->y;
    const Instant at = segment_instant(s, i->t);
    const int shown = i->method->exact && i->t == s->state.now.t && s->shown == s->stepped.evaluations;
    const int known = shown ? linear_plain(&s->stepped.linear)
                            : mechanism_motion_kept(&s->stepped, at, y, y + nq, s->active);
    const int kept = known && linear_apart(&s->stepped.linear) > KEPT_APART;
    if (!kept && mechanism_motion(&s->stepped, at, y, y + nq, s->active) != OK) return FAILED;
    mechanism_rates(&s->stepped, y + nq, i->f);
    memcpy(i->f + nq, s->stepped.vdot, (size_t)nv * sizeof *y);
    if (s->columns > 0) OPTIONAL.variation->rates(s, i->t, y, i->f + nq + nv);
    i->fresh = 0;
    if (i->method->begin != NULL) i->method->begin(i, s);
    if (!kept) segment_choose_rows(s);
    if (OPTIONAL.passage != NULL) OPTIONAL.passage->look(s, i->t, y); /* evaluates elsewhere */
    return OK;
}

Status segment_step(Solver *s, Integrator *i, double t_bound, double longest) {
    s->stages.narrowest = s->stages.apart = 1;
    if (!i->method->of_mechanism && accept(s, i) != OK) return FAILED;
    const Control c = control(s, i, longest);
    if (i->method->of_mechanism) {
        const Instant at = segment_instant(s, i->t);
        const Acting acting = {&s->stepped, s->active, s->state.offset, at.u, at.p};
        return i->method->step(i, &(Ode){.mechanism = &acting}, &c, t_bound);
    }
    const Ode ode = equations_at(s, i->t);
    if (i->method->step(i, &ode, &c, t_bound) != OK) return FAILED;
    if (s->columns > 0) OPTIONAL.variation->stepped(s, i);
    return i->method->error != NULL ? check_fixed_step(s, i) : OK;
}

Status segment_rate(Solver *s, Integrator *i) {
    const Ode ode = equations_at(s, i->t);
    return step_size_rate(i, &ode);
}

Status segment_prepare_dense(Solver *s, Integrator *i) {
    const Ode ode = equations_at(s, i->t);
    if (i->method->prepare_dense != NULL && i->method->prepare_dense(i, &ode) != OK) return FAILED;
    if (s->columns > 0) OPTIONAL.variation->stepped(s, i);
    return OK;
}

int segment_dense_rough(Solver *s, Integrator *i) {
    const Ode ode = equations_at(s, i->t);
    Control c = control(s, i, HUGE_VAL);
    double error;
    c.tolerance = segment_tolerance(s); /* these errors do not add up */
    if (i->method->dense_error == NULL) return 0;
    return i->method->dense_error(i, &ode, &c, &error) != OK || !(error <= 1);
}

Status segment_project(Solver *s, double t, double *y) {
    const Instant at = segment_instant(s, t);
    if (mechanism_project(&s->stepped, at, y, y + s->system->nq, s->active, s->state.offset, s->state.span) != OK)
        return FAILED;
    return s->columns == 0 ? OK : OPTIONAL.variation->project(s, at, y);
}

/* What rounding of the force on speed i makes of its acceleration. */
static double rounding_of_force(const Solver *s, int i) {
    const System *system = s->system;
    for (int e = 0; e < system->masses; e++) {
        if (system->mass_row[e] != i || system->mass_column[e] != i) continue;
        const double mass = s->stepped.M[e], force = fabs(s->stepped.F[i]);
        return mass > 0 ? BALANCED * force / mass : 0;
    }
    return 0;
}

/* Is that much of a step rounding of the forces, which others balance? */
static int is_balanced(const Solver *s, int j, double moved) {
    const System *system = s->system;
    const int nq = system->nq;
    const double h = s->integrator.t - s->integrator.t_old;
    double most = 0;
    if (j >= nq) return moved <= rounding_of_force(s, j - nq) * h;
    if (system->kinematics == NULL) return moved <= rounding_of_force(s, j) * h * h;
    for (int e = 0; e < system->rates; e++)
        if (system->rate_row[e] == j)
            most += fabs(s->stepped.B[e]) * rounding_of_force(s, system->rate_column[e]);
    return moved <= most * h * h;
}

Status segment_check_projection(Solver *s, double t, const double *y, const double *projected) {
    const double far = fmax(FAR * s->settings.tolerance, LEAST_FAR);
    if (s->integrator.method->fixed) return OK;
    if (s->system->prescribed_count > 0 && s->integrator.t_old == s->drive.since)
        return OK; /* a prescribed motion may have jumped when it was set */
    for (int j = 0; j < system_states(s->system); j++) {
        const double size = nominals_natural(s, j);
        const double moved = fabs(projected[j] - y[j]);
        const double known = fmax(fmax(fabs(y[j]), size), s->scale[j]); /* as the step's error */
        const StateName of = system_state_name(s->system, j);
        if (!(moved <= far * known) && !is_balanced(s, j, moved))
            return refused_projection(&s->why, t, (const char *const[]){of.head, of.name, of.tail},
                                      projected[j] - y[j]);
    }
    return OK;
}

Status segment_reach(Solver *s, double t0, const double *y0, double t1, double *y) {
    Integrator *i = &s->probe;
    const size_t bytes = (size_t)i->ny * sizeof *y;
    memcpy(y, y0, bytes);
    if (!(t1 > t0)) return OK;
    integrator_start(i, s->integrator.method, t0, y0, t1 - t0);
    while (i->t < t1)
        if (segment_step(s, i, t1, HUGE_VAL) != OK) return FAILED;
    memcpy(y, i->y, bytes);
    return segment_project(s, t1, y);
}

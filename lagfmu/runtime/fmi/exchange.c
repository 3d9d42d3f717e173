/* exchange.c -- an instance whose state is moved by an importer's integrator (Model Exchange).
 *
 * An importer's integrator knows no constraints: f = 0 and G v = nu, differentiated twice, drift away
 * (Hairer & Wanner II, sect. VII.2).  The accelerations that it gets are therefore stabilized,
 *
 *   G vdot = gamma - 2 alpha (G v - nu) - alpha^2 f           G vdot = gamma - alpha (G v - nu)
 *
 * (Baumgarte 1972; the second where there is no f), with alpha of the order of the motion's own rate
 * (exchange_gain.c), so that nothing becomes stiff and the drift stays in proportion to the importer's
 * tolerance, whatever that is.  lambda, as it is read, is that of the unstabilized equations; accelerations, and all
 * derivatives of these, are those that the importer integrates.  Where this does
 * not hold the drift (constraints that depend on each other) an event does (exchange_events.c).  Projection
 * alone would cost a restart of the importer's integrator each time. */
#include "exchange.h"

#include <math.h>
#include <string.h>

#include "friction.h"
#include "indicators.h"
#include "nominals.h"
#include "optional.h"
#include "schur.h"
#include "segment.h"

static const double NEAR = 100, LARGEST_NEAR = 1e-6; /* times the importer's tolerance, and that at most: of the size of a
                                                      * row, how far its solver carries it that has just let go, ... */
static const double REBOUNDED = 1e-13;               /* ... and what is rounding of one that has been struck */
static const double DISPLACEMENT = 6e-6; /* of a size: the cube root of rounding */

void exchange_begin(Instance *x) {
    memset(x->set, 0, (size_t)x->solver.system->inputs * sizeof *x->set);
}

void exchange_set_time(Instance *x, double t) {
    Solver *s = &x->solver;
    const System *system = s->system;
    if (s->state.now.t != t) x->version += 1;
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
    x->version += 1;
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
    double *still = x->work, *scale = still + states;
    memset(still, 0, (size_t)states * sizeof *still);
    nominals_shared(&x->solver, still, scale);
    for (int j = 0; j < states; j++) nominals[place_of(system, j)] = scale[j];
    if (EXCHANGE_LOST) nominals[states] = nominal_energy(&x->solver);
    for (int j = 0; j < states + EXCHANGE_LOST; j++)
        if (!(nominals[j] > STILL)) nominals[j] = 1; /* nothing tells it: FMI's own where none is given */
    return OK;
}

int exchange_flag_count(const Instance *x) {
    const System *s = x->solver.system, *full = system_read(s);
    return full->m + full->unique_count + s->frictions;
}

/* The place of a discrete value that is evaluated at the state; NULL: it is none. */
static int *flag_of(const Instance *x, const Variable *v) {
    const System *s = x->solver.system, *full = system_read(s);
    switch (v->place) {
        case AT_UNIQUE: return x->flag + v->index;
        case AT_OUTPUT_UNIQUE: return x->flag + full->m + v->index;
        case AT_STICKS: return x->flag + full->m + full->unique_count + v->index;
        default: return NULL;
    }
}

int exchange_held(const Instance *x, const Variable *v, double *value) {
    const int *flag = x->held ? flag_of(x, v) : NULL;
    if (flag != NULL) *value = *flag;
    return flag != NULL;
}

int exchange_nominals_news(Instance *x) {
    const int news = x->exchange && !x->weighed;
    x->weighed |= news;
    return news;
}

/* Accelerations and multipliers at the state. */
Status exchange_evaluate(Instance *x) {
    Solver *s = &x->solver;
    if (x->evaluated == x->version && x->evaluations == s->stepped.evaluations) return OK;
    if (instance_start(x) != OK) return FAILED;
    if (x->gain < 0 && exchange_find_gain(x) != OK) return FAILED;
    segment_begin(s);
    if (segment_motion(s, segment_instant(s, s->state.now.t), s->state.q, s->state.v) != OK) return FAILED;
    x->evaluated = x->version;
    x->evaluations = s->stepped.evaluations;
    return OK;
}

/* The multipliers of all rows, those too that depend on others. */
Status exchange_multipliers(Instance *x) {
    Solver *s = &x->solver;
    if (x->exchange && !s->state.now.dependent) return exchange_evaluate(x);
    if (instance_start(x) != OK) return FAILED;
    segment_begin(s);
    return segment_motion_near(s, segment_instant(s, s->state.now.t), s->state.q, s->state.v);
}

/* What leads back in row k: of its slip and its f, or of their changes. */
static double way_back(const Instance *x, int k, double slip, double f) {
    const int by_rate = x->solver.system->rows[k].kind == NONHOLONOMIC;
    return by_rate ? -x->gain * slip : -x->gain * (2 * slip + x->gain * f);
}

/* The accelerations a (nv) that lead back onto the constraints, and their multipliers mu (m), which may be NULL; by the
 * factors of the motion that was found last. */
static Status find_way_back(Instance *x, double *a, double *mu) {
    Solver *s = &x->solver;
    Mechanism *b = &s->stepped;
    double *c = s->sensitivity.c;
    memset(a, 0, (size_t)s->system->nv * sizeof *a);
    if (mu != NULL) memset(mu, 0, (size_t)s->system->m * sizeof *mu);
    if (!(x->gain > 0)) return OK;
    if (mechanism_residual(b, segment_instant(s, s->state.now.t), s->state.q, b->f) != OK) return FAILED;
    for (int k = 0; k < s->system->m; k++)
        c[k] = way_back(x, k, mechanism_slip(b, k, s->state.v), b->f[k] - s->state.offset[k]);
    if (linear_nearest(&b->linear, NULL, c, a, mu) != OK) /* rows contradict each other */
        memset(a, 0, (size_t)s->system->nv * sizeof *a);
    return OK;
}

int exchange_leads_back(const Instance *x) {
    return x->exchange && x->running && !x->dae && x->solver.system->full == NULL && x->solver.system->m > 0;
}

Status exchange_lead_back(Instance *x) {
    Solver *s = &x->solver;
    double *a = s->sensitivity.dvdot;
    if (s->state.now.dependent && exchange_evaluate(x) != OK) return FAILED;
    if (s->state.now.dependent) memcpy(x->seen.vdot, s->stepped.vdot, (size_t)s->system->nv * sizeof *a);
    if (find_way_back(x, a, NULL) != OK) return FAILED;
    for (int i = 0; i < x->solver.system->nv; i++) x->seen.vdot[i] += a[i];
    return OK;
}

/* The longest step along a direction that moves nothing by more than DISPLACEMENT of its size. */
static double step_along(const Solver *s, Direction d) {
    const System *system = s->system;
    const double rate = s->state.now.rate > 0 ? s->state.now.rate : 1;
    double most = fabs(d.dt) * rate;
    for (int j = 0; j < system->nq; j++)
        most = fmax(most, fabs(d.dq[j]) / (s->state.size[j] > 0 ? s->state.size[j] : 1));
    for (int i = 0; i < system->nv; i++) {
        const double size = fmax(s->state.span[i] * rate, fabs(s->state.v[i]));
        most = fmax(most, fabs(d.dv[i]) / (size > 0 ? size : 1));
    }
    for (int k = 0; k < system->inputs; k++)
        most = fmax(most, fabs(d.du[k]) / (s->drive.value[k] != 0 ? fabs(s->drive.value[k]) : 1));
    return most > 0 ? DISPLACEMENT / most : 0;
}

/* vdot (nv), as it is integrated, h along a direction from the state; the state stays. */
static Status find_beside(Instance *x, Direction d, double h, double *vdot) {
    Solver *s = &x->solver;
    const System *system = s->system;
    const int nq = system->nq, nv = system->nv;
    double *y = x->work, *u = x->back + 3 * nv + system->m;
    state_gather(system, s->state.q, s->state.v, y);
    memcpy(u, s->drive.value, (size_t)system->inputs * sizeof *u);
    for (int j = 0; j < nq; j++) s->state.q[j] += h * d.dq[j];
    for (int i = 0; i < nv; i++) s->state.v[i] += h * d.dv[i];
    for (int k = 0; k < system->inputs; k++) s->drive.value[k] += h * d.du[k];
    s->state.now.t += h * d.dt;
    x->version += 1;
    Status status = mechanism_settle(&s->stepped, segment_instant(s, s->state.now.t), s->state.q);
    if (status == OK) status = exchange_evaluate(x);
    if (status == OK) memcpy(vdot, s->stepped.vdot, (size_t)nv * sizeof *vdot);
    double *a = x->back + nv;
    if (status == OK) status = find_way_back(x, a, NULL);
    for (int i = 0; i < nv && status == OK; i++) vdot[i] += a[i];
    state_scatter(system, y, s->state.q, s->state.v);
    memcpy(s->drive.value, u, (size_t)system->inputs * sizeof *u);
    s->state.now.t -= h * d.dt;
    x->version += 1;
    return status;
}

/* Where rows depend on each other what is solved off the constraints has no derivative in closed form: by central
 * differences of the accelerations themselves. */
static Status difference_along(Instance *x, Direction d, double *change) {
    const int nv = x->solver.system->nv;
    const double h = step_along(&x->solver, d);
    double *before = x->back + 2 * nv;
    memset(change, 0, (size_t)nv * sizeof *change);
    if (!(h > 0)) return OK;
    const double t = x->solver.state.now.t;
    if (find_beside(x, d, -h, before) != OK || find_beside(x, d, h, change) != OK) return FAILED;
    for (int i = 0; i < nv; i++) change[i] = (change[i] - before[i]) / (2 * h);
    x->solver.state.now.t = t;
    return OK;
}

Status exchange_differentiate(Instance *x, Direction d) {
    Solver *s = &x->solver;
    Mechanism *b = &s->stepped;
    Sensitivity *w = &s->sensitivity;
    const int nv = s->system->nv, m = s->system->m;
    double *change = x->back, *a = change + nv, *mu = a + nv;
    if (s->state.now.dependent) return difference_along(x, d, change);
    if (find_way_back(x, a, mu) != OK) return FAILED;
    for (int i = 0; i < nv; i++) b->vdot[i] += a[i];
    for (int k = 0; k < m; k++) b->lambda[k] += mu[k];
    sensitivity_sides(w, b, x->at, s->state.q, s->state.v, d);
    for (int k = 0; k < m; k++)
        w->c[k] += way_back(x, k, sensitivity_slip(w, b, k, s->state.v, d.dv), w->df[k]);
    const Status solved = w->slide != NULL ? w->slide(w, b, x->at, s->state.q, s->state.v, d)
                                           : linear_nearest(&b->linear, w->b, w->c, w->dvdot, NULL);
    memcpy(change, w->dvdot, (size_t)nv * sizeof *change);
    for (int i = 0; i < nv; i++) b->vdot[i] -= a[i];
    for (int k = 0; k < m; k++) b->lambda[k] -= mu[k];
    return solved;
}

Status exchange_derivatives(Instance *x, double *derivatives) {
    Solver *s = &x->solver;
    Mechanism *b = &s->stepped;
    const System *system = s->system;
    double *rate = x->work;
    if (exchange_evaluate(x) != OK) return FAILED;
    mechanism_rates(b, s->state.v, rate);
    for (int j = 0; j < system->nq; j++) derivatives[place_of(system, j)] = rate[j];
    for (int i = 0; i < system->nv; i++) derivatives[place_of(system, system->nq + i)] = b->vdot[i];
    if (EXCHANGE_LOST) derivatives[system_states(system)] = OPTIONAL.friction->power(s);
    if (find_way_back(x, s->sensitivity.dvdot, NULL) != OK) return FAILED;
    for (int i = 0; i < system->nv; i++)
        derivatives[place_of(system, system->nq + i)] += s->sensitivity.dvdot[i];
    return OK;
}

double exchange_limit(const Instance *x, int c) {
    const Solver *s = &x->solver;
    const State *state = &s->state;
    const Latest *left = &state->latest[DEPARTURE], *met = &state->latest[CLOSING];
    if (!x->dae) return state->gap[c];
    if (state->armed[c]) return 0;
    const int parted = left->count[c] > 0 && !(met->count[c] > 0 && met->time[c] > left->time[c]);
    const double size = mechanism_row_size(&s->stepped, s->system->contact[c], state->span);
    return parted ? fmax(state->gap[c], NEAR * fmin(x->tolerance, LARGEST_NEAR) * size)
                  : fmin(state->gap[c], REBOUNDED * size);
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
        indicators[c] = s->state.closed[c] ? b->lambda[k] : b->f[k] + exchange_limit(x, c);
    }
    return OK;
}

/* Of the surface of switch k, by a central difference of it alone; of a floor, of what is left to the next whole
 * number. */
static double change_of_surface(const Instance *x, int k, Direction d) {
    const Solver *s = &x->solver;
    const System *system = s->system;
    const int nq = system->nq, inputs = system->inputs;
    double *q = x->work, *u = x->back + 3 * system->nv + system->m, *h = x->indicators, change = 0, now = 0;
    const double step = step_along(s, d);
    if (!(step > 0)) return 0;
    memcpy(u, x->at.u, (size_t)(inputs + system->switches) * sizeof *u);
    for (int side = -1; side <= 1; side++) {
        for (int j = 0; j < nq; j++) q[j] = s->state.q[j] + side * step * d.dq[j];
        for (int j = 0; j < inputs; j++) u[j] = x->at.u[j] + side * step * d.du[j];
        system->surfaces(x->at.t + side * step * d.dt, q, u, x->at.p, h);
        change += side * h[k] / (2 * step);
        if (side == 0) now = h[k];
    }
    if (!system->at_integers[k]) return change;
    const Range range = OPTIONAL.switches->range(s, k);
    return now - range.low < range.high - now ? change : -change;
}

/* Of friction i: of the reserve (held - asked) / (held + asked) of its cone, or of its slip; of its normal force. */
static double change_of_friction(const Instance *x, int i, int of_normal) {
    const Mechanism *b = &x->solver.stepped;
    const Sensitivity *w = &x->solver.sensitivity;
    const struct FrictionForces *f = b->friction;
    const StickSlip *mode = &f->stick_slip[i];
    const Friction *law = &b->system->friction[i];
    double force[2];
    if (!f->loaded[i]) return 0;
    if (of_normal) return mode->sticks || law->gated || law->parts > 1 ? 0 : w->dnormal[i];
    if (!mode->sticks) return w->dslip[2 * i] * mode->direction[0] + w->dslip[2 * i + 1] * mode->direction[1];
    const double held = f->mu[2 * i] * f->normal[i], asked = friction_tangential(b, i, b->lambda, force);
    const double dheld = w->dmu[2 * i] * f->normal[i] + f->mu[2 * i] * w->dnormal[i], dasked = dheld - w->dmargin[i];
    const double sum = held + asked;
    return sum > 0 ? 2 * (asked * dheld - held * dasked) / (sum * sum) : 0;
}

double exchange_change_of_indicator(const Instance *x, int i, Direction d) {
    const Solver *s = &x->solver;
    const System *system = s->system;
    const int of_friction = i - indicators_first_of_frictions(system);
    if (x->apart) return NAN;
    if (of_friction >= 0) return change_of_friction(x, of_friction / 2, of_friction % 2);
    if (i >= system->contacts) return change_of_surface(x, i - system->contacts, d);
    const int k = system->contact[i];
    if (!s->state.closed[i]) return s->sensitivity.df[k];
    return s->stepped.linear.unique[k] ? s->sensitivity.dlambda[k] : NAN;
}

/* initialization.c -- a consistent start: projection of start values onto the constraints, contact modes,
 * nominals.
 *
 * Positions are projected (initial_projection.c) onto the constraints that always act and onto contacts that
 * are penetrated (f < gap); then velocities onto G v = nu; then the contacts that touch are closed if their
 * multiplier is positive. */
#include <float.h>
#include <string.h>

#include "digits.h"
#include "initial_projection.h"
#include "nominals.h"
#include "optional.h"
#include "segment.h"
#include "thresholds.h"

/* An angle whose neighbouring numbers are no neighbouring directions is refused. */
static Status check_angles(const Start *x) {
    const System *s = x->s->system;
    const double *q = x->s->state.q;
    for (int j = 0; j < s->nq; j++) {
        if (s->dimension[j] != s->angles || fabs(q[j]) <= LARGEST_ANGLE) continue;
        return fail(&x->s->why,
                    "the start is refused: the angle %s = %s rad has no digits left for a "
                    "direction, expected at most %.1e rad either way: take off whole turns",
                    s->coordinates[j], digits(q[j]).text, LARGEST_ANGLE);
    }
    return OK;
}

/* A mass that a double holds to a few digits only is refused. */
static Status check_masses(const Start *x) {
    const Mechanism *b = &x->s->stepped;
    const System *s = b->system;
    for (int e = 0; e < s->masses; e++) {
        if (s->mass_row[e] != s->mass_column[e]) continue;
        if (!(b->M[e] > 0 && b->M[e] < DBL_MIN)) continue;
        return fail(&x->s->why,
                    "the start is refused: the mass of %s is %s, expected 0 or at least %.3g (in SI "
                    "units), below which numbers lose their digits: choose larger units of mass",
                    s->speeds[s->mass_row[e]], digits(b->M[e]).text, DBL_MIN);
    }
    return OK;
}

/* Positions on the constraints; contacts that touch or were penetrated are closed, for now. */
/* At half a turn the rows of a joint vanish, too. */
static Status check_turned_over(const Start *x) {
    const System *s = x->s->system;
    double *side = x->s->stepped.f;
    if (s->side_count == 0) return OK;
    s->sides(x->at.t, x->s->state.q, x->at.u, x->at.p, side);
    for (int i = 0; i < s->side_count; i++) {
        const char *name = s->rows[s->sided[i]].name;
        if (!(side[i] > 0))
            return fail(&x->s->why,
                        "the start is refused: at the start values that were set joint '%.*s' is turned over by half a "
                        "turn: set attitudes of its bodies that are nearer to where its axes point the same way",
                        (int)strcspn(name, "."), name);
    }
    return OK;
}

static Status find_positions(const Start *x) {
    const System *s = x->s->system;
    State *state = &x->s->state;
    Mechanism *b = &x->s->stepped;
    double *moved = x->s->part.start->work + 3 * s->nq + 3 * s->m;
    int *rows = x->s->part.start->rows;
    memcpy(state->q, x->q0, (size_t)s->nq * sizeof *state->q);
    if (mechanism_settle(b, x->at, state->q) == FAILED) return initial_refused(x->s);
    memset(state->closed, 0, (size_t)s->contacts * sizeof *state->closed);
    system_active(s, state->closed, rows);
    if (initial_positions(x, state->q, rows) == FAILED) return FAILED;
    for (int count = 0; count <= s->contacts; count++) {
        if (mechanism_evaluate(b, x->at, state->q, x->v0) == FAILED) return initial_refused(x->s);
        if (mechanism_residual(b, x->at, state->q, b->f) == FAILED) return initial_refused(x->s);
        nominals_gaps(x->s, x->at, state->q);
        for (int c = 0; c < s->contacts; c++) state->closed[c] = b->f[s->contact[c]] <= state->gap[c];
        system_active(s, state->closed, rows);
        memcpy(moved, state->q, (size_t)s->nq * sizeof *moved);
        if (initial_positions(x, moved, rows) == FAILED) return FAILED;
        int still = 1;
        for (int j = 0; j < s->nq; j++)
            still &= fabs(moved[j] - state->q[j]) <= 4 * DBL_EPSILON * state->size[j];
        if (still) break;
        memcpy(state->q, moved, (size_t)s->nq * sizeof *moved);
    }
    if (check_angles(x) == FAILED || check_turned_over(x) == FAILED) return FAILED;
    nominals_sizes(x->s, x->at, state->q);
    return OK;
}

/* natural (nv): the speeds that the forces give within what they move, sqrt(span |F| / M). */
static void natural_speeds(const Start *x, double *natural) {
    const Mechanism *b = &x->s->stepped;
    const System *s = b->system;
    for (int j = 0; j < s->nv; j++) natural[j] = 0;
    for (int e = 0; e < s->masses; e++) {
        int j = s->mass_row[e];
        if (s->mass_column[e] == j && b->M[e] > 0)
            natural[j] = sqrt(x->s->state.span[j]) * sqrt(fabs(b->F[j]) / b->M[e]);
    }
}

/* Every row that acts has G v = nu to rounding; otherwise the constraints contradict each other. */
static Status check_velocities(const Start *x, const int *active, double *fastest, double *shared) {
    Solver *solver = x->s;
    const Mechanism *b = &solver->stepped;
    const System *s = b->system;
    const double *v = solver->state.v;
    int missed = 0;
    for (int j = 0; j < s->nv; j++)
        fastest[j] = fmax(fmax(fabs(x->v0[j]), fabs(v[j])), fastest[j]);
    mechanism_motion_speeds(b, fastest, shared);
    for (int k = 0; k < s->m; k++) {
        double unit = mechanism_row_size(b, k, shared) + fabs(b->nu[k]);
        if (!active[k] || fabs(mechanism_slip(b, k, v)) <= TOUCH * unit) continue;
        if (!missed) fail(&solver->why, "no velocities satisfy the constraints ");
        why_append(&solver->why, "%s'%s'", missed ? ", " : "", s->rows[k].name);
        missed = 1;
    }
    if (!missed) return OK;
    why_append(&solver->why, " at the start: they contradict each other, or the configuration is "
                             "singular");
    return FAILED;
}

/* Of the contacts that touch and depart, those that would not rise above the gap within which contacts touch,
 * v^2 <= 2 a gap, are closed; whether there are any. */
static Status close_low(const Start *x, int *active, int *any) {
    const System *s = x->s->system;
    State *state = &x->s->state;
    Mechanism *b = &x->s->stepped;
    int parting = 0;
    *any = 0;
    if (s->contacts == 0) return OK;
    if (mechanism_residual(b, x->at, state->q, b->f) == FAILED) return FAILED;
    for (int c = 0; c < s->contacts; c++)
        parting |= !state->closed[c] && b->f[s->contact[c]] <= state->gap[c];
    if (!parting) return OK;
    if (mechanism_motion(b, x->at, state->q, state->v, active) == FAILED) return FAILED;
    if (mechanism_residual(b, x->at, state->q, b->f) == FAILED) return FAILED;
    for (int c = 0; c < s->contacts; c++) {
        const int k = s->contact[c];
        const double speed = mechanism_slip(b, k, state->v);
        const double pull = b->gamma[k] - mechanism_row(b, k, b->vdot);
        if (state->closed[c] || !(b->f[k] <= state->gap[c])) continue;
        if (pull > 0 && speed * speed <= 2 * pull * state->gap[c]) state->closed[c] = *any = 1;
    }
    return OK;
}

/* Velocities on G v = nu of the rows that act. */
static Status move_velocities(const Start *x, int *active, const double *natural) {
    State *state = &x->s->state;
    Mechanism *b = &x->s->stepped;
    system_active(x->s->system, state->closed, active);
    if (initial_velocities(x, state->q, natural, active, state->v) == FAILED) return FAILED;
    return mechanism_project(b, x->at, state->q, state->v, active, state->offset, state->span);
}

/* Velocities on G v = nu; a contact that is already departing (df/dt > 0) is open, unless so slowly
 * that it comes to rest, as after an impact. */
static Status find_velocities(const Start *x) {
    const System *s = x->s->system;
    State *state = &x->s->state;
    Mechanism *b = &x->s->stepped;
    double *natural = x->s->part.start->work, *fastest = natural + s->nv, *shared = fastest + s->nv;
    int *active = x->s->part.start->rows, low = 1;
    if (mechanism_evaluate(b, x->at, state->q, x->v0) == FAILED) return initial_refused(x->s);
    if (check_masses(x) == FAILED) return FAILED;
    natural_speeds(x, natural);
    for (int j = 0; j < s->nv; j++) fastest[j] = fmax(fabs(x->v0[j]), natural[j]);
    mechanism_motion_speeds(b, fastest, shared);
    for (int c = 0; c < s->contacts; c++) {
        int k = s->contact[c];
        double speed = mechanism_slip(b, k, x->v0), own = TOUCH * mechanism_row_size(b, k, fastest);
        if (speed > fmax(own, LOST * mechanism_row_size(b, k, shared))) state->closed[c] = 0;
    }
    while (low) {
        if (move_velocities(x, active, natural) == FAILED) return initial_refused(x->s);
        if (close_low(x, active, &low) == FAILED) return initial_refused(x->s);
    }
    if (mechanism_evaluate(b, x->at, state->q, state->v) == FAILED) return initial_refused(x->s);
    return check_velocities(x, active, natural, shared);
}

/* Contact modes by complementarity, and the state on the rows that then act. */
static Status find_modes(const Start *x) {
    const System *s = x->s->system;
    State *state = &x->s->state;
    Mechanism *b = &x->s->stepped;
    int *touching = x->s->part.start->rows + s->m;
    memcpy(touching, state->closed, (size_t)s->contacts * sizeof *touching);
    if (s->contacts > 0 && OPTIONAL.contacts->modes(x->s, x->at, state->q, state->v, state->closed,
                                                touching, NULL) == FAILED)
        return initial_refused(x->s);
    if (s->frictions > 0 &&
        OPTIONAL.friction->begin(x->s, x->at, state->closed, touching) == FAILED)
        return initial_refused(x->s);
    system_active(s, state->closed, x->s->active);
    if (mechanism_project(b, x->at, state->q, state->v, x->s->active, state->offset,
                          state->span) == FAILED)
        return initial_refused(x->s);
    if (mechanism_motion(b, x->at, state->q, state->v, x->s->active) == FAILED)
        return initial_refused(x->s);
    segment_choose_rows(x->s);
    return OK;
}

/* A start value is its own scale, so that a start at theta0 = 1e-6 is resolved. */
static Status find_nominals(const Start *x) {
    Solver *s = x->s;
    const int nq = s->system->nq, nv = s->system->nv;
    for (int j = 0; j < nq; j++) s->state.scale[j] = fabs(s->state.q[j]);
    for (int i = 0; i < nv; i++) s->state.scale[nq + i] = fabs(s->state.v[i]);
    return nominals_complete(s, x->at, 0);
}

void initial_moved(const Start *x, Moved moved, void *context) {
    const State *state = &x->s->state;
    const int nq = x->s->system->nq;
    for (int i = 0; i < system_states(x->s->system); i++) {
        int is_velocity = i >= nq, j = is_velocity ? i - nq : i;
        double given = is_velocity ? x->v0[j] : x->q0[j];
        double used = is_velocity ? state->v[j] : state->q[j];
        double unit = fmax(is_velocity ? state->scale[i] : state->size[j], fabs(given));
        /* a velocity that is rounding of the motion's own has not moved */
        double rounding = 4 * DBL_EPSILON * nominals_natural(x->s, i);
        if (fabs(given - used) > fmax(MOVED * unit, rounding))
            moved(context, i, given, used, is_velocity ? x->priority_v[j] : x->priority_q[j]);
    }
}

static Status check_start_finite(Solver *s, const double *q0, const double *v0) {
    const System *system = s->system;
    for (int j = 0; j < system_states(system); j++) {
        const int is_velocity = j >= system->nq;
        const double given = is_velocity ? v0[j - system->nq] : q0[j];
        if (fabs(given) <= DBL_MAX) continue;
        const StateName of = system_state_name(system, j);
        return fail(&s->why, "the start is refused: %s%s%s = %s is not finite", of.head, of.name, of.tail,
                    digits(given).text);
    }
    return OK;
}

/* Nothing has happened yet: no steps, no departures, every row without an offset. */
SHARED void solver_clear(Solver *s, double t) {
    State *state = &s->state;
    memset(state->block, 0, state->block_size);
    memset(&state->now, 0, sizeof state->now);
    state->now.t = t;
    state->now.approach = (Approach){t, APART_UNKNOWN, -1, 0};
    state->now.fresh = 1;
}

Status solver_start(Solver *s, double t, const double *q0, const double *v0, const Priority *priority,
                    Moved moved, void *context) {
    if (check_start_finite(s, q0, v0) == FAILED) return FAILED;
    solver_clear(s, t);
    const Start x = {s, segment_instant(s, t), q0, v0, priority, s->part.start->moves, priority + s->system->nq};
    priority_moves(s->system, priority, s->part.start->moves);
    if (s->system->switches > 0) OPTIONAL.switches->settle(s, x.at, q0, v0, NULL, NULL);
    if (s->system->contacts > 0 && OPTIONAL.contacts->check(s) != OK) return FAILED;
    s->stepped.dependent = 1; /* it is not known yet */
    nominals_sizes(s, x.at, q0);
    if (find_positions(&x) == FAILED) return FAILED;
    if (s->system->switches > 0) OPTIONAL.switches->settle(s, x.at, s->state.q, v0, NULL, NULL);
    if (find_velocities(&x) == FAILED) return FAILED;
    if (find_modes(&x) == FAILED) return FAILED;
    for (int c = 0; c < s->system->contacts; c++) s->state.armed[c] = !s->state.closed[c];
    if (mechanism_residual(&s->stepped, x.at, s->state.q, s->stepped.f) == FAILED) return initial_refused(s);
    nominals_watch(s, x.at, s->state.q);
    nominals_gaps(s, x.at, s->state.q);
    if (find_nominals(&x) == FAILED) return FAILED;
    if (OPTIONAL.crossing != NULL && s->state.now.rate > 0) {
        if (OPTIONAL.crossing->begins(s) != OK) return initial_refused(s);
        if (mechanism_motion(&s->stepped, x.at, s->state.q, s->state.v, s->active) != OK) return initial_refused(s);
    }
    if (moved != NULL) initial_moved(&x, moved, context);
    return OK;
}

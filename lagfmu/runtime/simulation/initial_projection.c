/* initial_projection.c -- start values onto the constraints, from however far, by start priority.
 *
 *   M w = G^T mu ,  G w = -f ,  q <- q + B w     damped Newton's method (Deuflhard, Newton Methods for
 *                                  Nonlinear Problems, sect. 3.1), the step halved until |f| falls
 *   M dv = G^T mu ,  G dv = nu - G v
 *
 * of the coordinates that are free in a stage; each stage begins at the start values as they were given.  The last
 * one holds higher priorities but gently: beside a value beyond reach that is held firmly, the others are led to where
 * they move the constraint no more, and no step is left. */
#include "initial_projection.h"

#include <float.h>
#include <string.h>

#include "digits.h"
#include "nominals.h"
#include "thresholds.h"

enum { STEP_HALVINGS = 25 };

void start_layout(Solver *s, Arena *scratch) {
    const System *of = s->system;
    struct StartMemory counted, *x = arena_take(scratch, 1, sizeof *x);
    s->part.start = x;
    if (x == NULL) x = &counted;
    x->moves = arena_take(scratch, (size_t)of->nv, sizeof *x->moves);
    x->work = arena_doubles(scratch, 6 * of->nq + 3 * of->m);
    x->rows = arena_ints(scratch, 2 * of->m + of->contacts);
}

Status initial_refused(Solver *s) {
    Why cause = s->why;
    return fail(&s->why, "the start is refused: %s", cause.text);
}

/* allowed (m): `factor` roundings of each constraint's terms at q, no smaller than those of `least`. */
static void find_allowed(const Start *x, const double *q, const double *least, double factor,
                         double *reach, double *allowed) {
    const System *s = x->s->system;
    const Mechanism *b = &x->s->stepped;
    for (int i = 0; i < s->nv; i++) reach[i] = fmax(mechanism_reach(b, q, i), mechanism_reach(b, least, i));
    for (int k = 0; k < s->m; k++) allowed[k] = factor * DBL_EPSILON * mechanism_row_size(b, k, reach);
}

static int arrived(const System *s, const int *rows, const double *f, const double *allowed) {
    for (int k = 0; k < s->m; k++)
        if (rows[k] && !(fabs(f[k]) <= allowed[k])) return 0;
    return 1;
}

/* |f| on the rows in units of what may be left; of f0 where nothing may. */
static double norm_of_misses(const System *s, const int *rows, const double *f, const double *allowed,
                             const double *f0) {
    double sum = 0;
    for (int k = 0; k < s->m; k++) {
        double unit = allowed[k] > 0 ? allowed[k] : f0[k] != 0 ? fabs(f0[k]) : 1;
        if (rows[k]) sum += f[k] / unit * (f[k] / unit);
    }
    return sqrt(sum);
}

/* The largest f of the rows relative to its terms; allowed (m): 1e3 roundings of these. */
static double find_far_off(const System *s, const int *rows, const double *f, const double *allowed) {
    double off = 0;
    for (int k = 0; k < s->m; k++)
        if (rows[k] && allowed[k] > 0) off = fmax(off, 1e3 * DBL_EPSILON * fabs(f[k]) / allowed[k]);
    return off < INITIAL_NEAR ? off : 0;
}

static Status cannot_be_projected(const Start *x, const int *rows, const double *f,
                                  const double *allowed) {
    const System *s = x->s->system;
    Why *why = &x->s->why;
    const char *comma = "";
    fail(why, "the start values cannot be projected onto the constraints: choose some near a configuration that "
              "satisfies them, or other parameters (missed: ");
    for (int k = 0; k < s->m; k++)
        if (rows[k] && !(fabs(f[k]) <= allowed[k])) {
            why_append(why, "%s'%s' by %.3g", comma, s->rows[k].name, f[k]);
            comma = ", ";
        }
    for (int j = 0; j < s->nq; j++) {
        Digits given = digits(x->q0[j]);
        why_append(why, "%s%s = %s", j > 0 ? ", " : "; start values: ", s->coordinates[j], given.text);
    }
    why_append(why, ")");
    return FAILED;
}

/* One stage: q is moved.
 *
 * It has arrived where f is rounding of its terms, which are of the size of q or of a parameter, for angles of
 * 1 rad, since their sines and cosines stand beside 1; or, since f may hold larger ones (an input), where f falls
 * no more and is rounding of what it was made of at the start (`size`).  While it falls on and on, there is
 * nothing to arrive at. */
static Status newton_at_start(const Start *x, int stage, double *q, const int *rows) {
    const System *s = x->s->system;
    Mechanism *b = &x->s->stepped;
    double *trial = x->s->part.start->work, *least = trial + s->nq, *f = least + s->nq;
    double *f_trial = f + s->m, *allowed = f_trial + s->m;
    int *own = x->s->part.start->rows + s->m;
    const int all = priority_rows(s, x->moves, stage, rows, own);
    nominals_extents(s, x->at.p, least);
    for (int j = 0; j < s->nq; j++)
        if (s->dimension[j] == s->angles) least[j] = 1;
    if (mechanism_residual(b, x->at, q, f) == FAILED) return initial_refused(x->s);
    for (int count = 0;; count++) {
        if (mechanism_evaluate(b, x->at, q, x->v0) == FAILED) return initial_refused(x->s);
        find_allowed(x, q, least, 4, trial, allowed);
        if (arrived(s, rows, f, allowed)) return OK;
        if (count == INITIAL_ITERATIONS) return cannot_be_projected(x, rows, f, allowed);
        find_allowed(x, q, x->s->state.size, 1e3, trial, allowed);
        if (!all && arrived(s, own, f, allowed)) break; /* what is left is not for these coordinates */
        for (int k = 0; k < s->m; k++) f_trial[k] = -f[k];
        b->linear.off = find_far_off(s, own, f, allowed);
        const Status status = priority_nearest(b, x->moves, stage, own, f_trial);
        b->linear.off = 0;
        if (status == FAILED) break;
        double damping = 1;
        int halvings = 0;
        for (; halvings < STEP_HALVINGS; halvings++, damping /= 2) {
            memcpy(trial, q, (size_t)s->nq * sizeof *q);
            mechanism_move(b, damping, b->dq, trial);
            if (mechanism_settle(b, x->at, trial) == FAILED) continue;
            if (mechanism_residual(b, x->at, trial, f_trial) == FAILED) continue;
            if (norm_of_misses(s, own, f_trial, allowed, f) <
                (1 - 0.1 * damping) * norm_of_misses(s, own, f, allowed, f))
                break;
        }
        if (halvings == STEP_HALVINGS) break;
        memcpy(q, trial, (size_t)s->nq * sizeof *q);
        memcpy(f, f_trial, (size_t)s->m * sizeof *f);
    }
    return arrived(s, rows, f, allowed) ? OK : cannot_be_projected(x, rows, f, allowed);
}

/* Whether G_ki is not 0 where what speed i moves is put aside. */
static int depends_elsewhere(const Start *x, const double *q, int entry, double aside) {
    const System *s = x->s->system;
    Mechanism *b = &x->s->stepped;
    double *elsewhere = x->s->part.start->work, *along = elsewhere + s->nq;
    memcpy(elsewhere, q, (size_t)s->nq * sizeof *q);
    for (int i = 0; i < s->nv; i++) along[i] = i == s->entry_column[entry] ? aside : 0;
    mechanism_kinematics(b, x->at, q);
    mechanism_move(b, 1, along, elsewhere);
    return mechanism_settle(b, x->at, elsewhere) == OK && mechanism_evaluate(b, x->at, elsewhere, x->v0) == OK && b->G[entry] != 0;
}

/* Refuses, naming the coordinate, where an omitted value's 0 is singular: the row k is missed by f, none
 * of the omitted coordinates in it has a derivative there, and one has elsewhere. */
static Status check_omissions(const Start *x, const double *q, int k, double f) {
    const System *s = x->s->system;
    Mechanism *b = &x->s->stepped;
    double aside = 0;
    if (mechanism_evaluate(b, x->at, q, x->v0) == FAILED) return initial_refused(x->s);
    for (int j = 0; j < s->nq; j++) aside = fmax(aside, fabs(q[j]));
    for (int e = s->row_start[k]; e < s->row_start[k + 1]; e++)
        if (x->moves[s->entry_column[e]] == OMITTED && b->G[e] != 0) return OK;
    for (int e = s->row_start[k]; e < s->row_start[k + 1]; e++) {
        const char *name = s->speeds[s->entry_column[e]];
        if (x->moves[s->entry_column[e]] != OMITTED) continue;
        if (!depends_elsewhere(x, q, e, aside > 0 ? aside : 1)) continue;
        return fail(&x->s->why,
                    s->kinematics == NULL
                        ? "the start is refused: %s has no start value, and at 0 constraint '%s', missed by "
                          "%.3g, does not depend on it to first order: give %s a start value"
                        : "the start is refused: what %s moves has no start values, and at 0 constraint '%s', "
                          "missed by %.3g, does not depend on it to first order: give what %s moves start values",
                    name, s->rows[k].name, f, name);
    }
    return OK;
}

static Status check_all_omissions(const Start *x, const double *q, const int *rows) {
    const System *s = x->s->system;
    double *f = x->s->part.start->work + 2 * s->nq;
    if (mechanism_residual(&x->s->stepped, x->at, q, f) == FAILED) return initial_refused(x->s);
    for (int k = 0; k < s->m; k++)
        if (rows[k] && f[k] != 0 && check_omissions(x, q, k, f[k]) == FAILED) return FAILED;
    return OK;
}

Status initial_positions(const Start *x, double *q, int *rows) {
    const System *s = x->s->system;
    const size_t bytes = (size_t)s->nq * sizeof *q;
    double *given = x->s->part.start->work + 5 * s->nq + 3 * s->m;
    int any = 0;
    for (int k = 0; k < s->m; k++) {
        if (s->rows[k].kind == NONHOLONOMIC) rows[k] = 0;
        any |= rows[k];
    }
    if (!any) return OK;
    memcpy(given, q, bytes);
    for (int stage = 0; stage <= PRIORITIES; stage++) {
        stage = priority_stage(s, x->moves, stage);
        memcpy(q, given, bytes);
        if (newton_at_start(x, stage, q, rows) == OK) return OK;
        if (stage == OMITTED && check_all_omissions(x, given, rows) == FAILED) return FAILED;
    }
    return FAILED;
}

/* slip (m) = nu - G v; whether it is rounding on the rows `own`. */
static int on_velocities(const Start *x, const double *least, const double *v, const int *own,
                         double *speed, double *slip) {
    const System *s = x->s->system;
    const Mechanism *b = &x->s->stepped;
    double *shared = speed + s->nv;
    int on = 1;
    for (int j = 0; j < s->nv; j++) speed[j] = fmax(fmax(fabs(v[j]), fabs(x->v0[j])), least[j]);
    mechanism_motion_speeds(b, speed, shared);
    for (int k = 0; k < s->m; k++) {
        slip[k] = -mechanism_slip(b, k, v);
        const double terms = mechanism_row_size(b, k, shared) + fabs(b->nu[k]);
        on &= !own[k] || fabs(slip[k]) <= INITIAL_ARRIVED * terms;
    }
    return on;
}

Status initial_velocities(const Start *x, const double *q, const double *least, const int *rows, double *v) {
    const System *s = x->s->system;
    Mechanism *b = &x->s->stepped;
    double *slip = x->s->part.start->work + 3 * s->nq, *speed = slip + s->m;
    int *own = x->s->part.start->rows + s->m;
    memcpy(v, x->v0, (size_t)s->nv * sizeof *v);
    for (int stage = 0; (stage = priority_stage(s, x->priority_v, stage)) < PRIORITIES; stage++) {
        memcpy(v, x->v0, (size_t)s->nv * sizeof *v);
        priority_rows(s, x->priority_v, stage, rows, own);
        for (int sweep = 0; sweep < INITIAL_SWEEPS; sweep++) {
            if (mechanism_evaluate(b, x->at, q, x->v0) == FAILED) return FAILED;
            if (on_velocities(x, least, v, rows, speed, slip)) return OK;
            if (on_velocities(x, least, v, own, speed, slip)) break;
            if (priority_nearest(b, x->priority_v, stage, own, slip) == FAILED) break;
            for (int j = 0; j < s->nv; j++) v[j] += b->dq[j];
        }
    }
    return OK;
}

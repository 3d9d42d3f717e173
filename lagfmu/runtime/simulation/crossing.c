/* crossing.c -- where constraints depend on each other for an instant two branches of the motion cross: which rows, how
 * near, and whether a motion can begin there. */
#include "crossing.h"

#include <float.h>
#include <math.h>
#include <string.h>

#include "segment.h"
#include "state.h"

static const double START_NEAR = 1e-2;   /* angle below which a start may be too near a crossing: ... */
static const double START_BESIDE = 1e-2; /* sizes: so far beside it the motion is looked at, ... */
enum { BESIDES = 5 };
static const double POLYNOMIAL[BESIDES] = {5, -10, 10, -5, 1}; /* through so many places: what it is at the start */
static const double OPENS = 2;           /* if the angle is so many times as wide there; ... */
static const double FORCES_LOST = 1e-3;  /* of the forces at work: by how much multipliers may differ */
static const double ROUNDED = 10;        /* roundings of a row, which its constraint cannot tell from the start */

struct CrossingMemory {
    double *y, *rate; /* (solver_width()) beside a start */
    double *along;    /* (nv) one speed */
    double *sum;      /* (2 m + 3 nv) */
    double *alike;    /* (masses) of speeds that count by what they move */
};

static void crossing_layout(Solver *s, Arena *scratch) {
    struct CrossingMemory counted, *x = arena_take(scratch, 1, sizeof *x);
    s->part.crossing = x;
    if (x == NULL) x = &counted;
    x->y = arena_doubles(scratch, solver_width(s));
    x->rate = arena_doubles(scratch, solver_width(s));
    x->along = arena_doubles(scratch, s->system->nv);
    x->sum = arena_doubles(scratch, 2 * s->system->m + 3 * s->system->nv);
    x->alike = arena_doubles(scratch, s->system->masses);
}

Status crossing_factor(Solver *s, double t, const double *y, double off) {
    Mechanism *b = &s->stepped;
    if (mechanism_evaluate(b, segment_instant(s, t), y, y + s->system->nq) != OK) return FAILED;
    b->linear.off = off;
    const Status status = linear_factor(&b->linear, b->M, b->G, solver_rows(s));
    b->linear.off = 0;
    return status;
}

int crossing_name_rows(Solver *s, Why *text) {
    int count = 0;
    for (int k = 0; k < s->system->m; k++) {
        if (s->stepped.linear.unique[k]) continue;
        why_append(text, "%s'%s'", count > 0 ? ", " : "", s->system->rows[k].name);
        count += 1;
    }
    return count;
}

/* What a speed moves, as a size of its dimension: an angle by 1 rad. */
static double span_of(const Solver *s, int i) {
    const int dimension = s->system->speed_dimension[i];
    return dimension == s->system->angles ? 1 : mechanism_largest_alike(s->system, dimension, s->state.span);
}

/* How far apart as many rows are as are independent, whatever the masses are: a light one between heavy ones is no
 * crossing.  Each speed counts by what it moves.  < 0: it is not known. */
static double rows_apart(Solver *s, double t, const double *y) {
    const System *system = s->system;
    Mechanism *b = &s->stepped;
    double *alike = s->part.crossing->alike;
    if (mechanism_evaluate(b, segment_instant(s, t), y, y + system->nq) != OK) return -1;
    for (int e = 0; e < system->masses; e++) {
        const int i = system->mass_row[e];
        const double span = span_of(s, i);
        alike[e] = i != system->mass_column[e] || !(b->M[e] > 0) ? 0 : span > 0 ? 1 / (span * span) : 1;
    }
    b->linear.off = s->state.now.dependent ? 0 : DBL_MIN;
    const Status status = linear_factor(&b->linear, alike, b->G, s->state.now.dependent ? s->active : solver_rows(s));
    b->linear.off = 0;
    if (status != OK) return -1;
    return s->state.now.dependent ? linear_furthest_apart(&b->linear) : linear_apart(&b->linear);
}

/* y (states) <- as the motion would be had it gone on, at the same t, by so many sizes of what it moves through. */
static Status go_beside(Solver *s, double t, double sizes, double *y) {
    const int nq = s->system->nq;
    Mechanism *b = &s->stepped;
    double *rate = s->part.crossing->rate, fastest = 0;
    for (int i = 0; i < s->system->nv; i++) {
        const double span = span_of(s, i);
        if (span > 0) fastest = fmax(fastest, fabs(s->state.v[i]) / span);
    }
    state_gather(s->system, s->state.q, s->state.v, y);
    if (!(fastest > 0)) return OK; /* nothing moves */
    mechanism_kinematics(b, segment_instant(s, t), y);
    mechanism_rates(b, y + nq, rate);
    for (int j = 0; j < nq; j++) y[j] += sizes / fastest * rate[j];
    return segment_project(s, t, y);
}

/* y (states) <- the start as the rows know it just as well, at the same t: moved along speed i by a rounding of them over
 * the angle between them. */
static Status go_unseen(Solver *s, double t, int i, double roundings, double apart, double *y) {
    const System *x = s->system;
    Mechanism *b = &s->stepped;
    double *rate = s->part.crossing->rate, *along = s->part.crossing->along;
    const double span = span_of(s, i);
    memset(along, 0, (size_t)x->nv * sizeof *along);
    along[i] = roundings * DBL_EPSILON / apart * (span > 0 ? span : 1);
    state_gather(x, s->state.q, s->state.v, y);
    mechanism_kinematics(b, segment_instant(s, t), y);
    mechanism_rates(b, along, rate);
    for (int j = 0; j < x->nq; j++) y[j] += rate[j];
    return segment_project(s, t, y);
}

/* Adds part times the multipliers (m), the same times the angle (m), and accelerations (nv), of the motion at y. */
static Status add_motion(Solver *s, double t, const double *y, double part, double *sum) {
    const int m = s->system->m;
    Mechanism *b = &s->stepped;
    const double apart = rows_apart(s, t, y);
    if (mechanism_motion(b, segment_instant(s, t), y, y + s->system->nq, s->active) != OK) return FAILED;
    for (int k = 0; k < m; k++) sum[k] += part * b->lambda[k];
    for (int k = 0; k < m; k++) sum[m + k] += part * apart * b->lambda[k];
    for (int i = 0; i < s->system->nv; i++) sum[2 * m + i] += part * b->vdot[i];
    return OK;
}

/* Are multipliers off by more than that part of the forces (nv) at work, or of those that they are of themselves? */
static int differ(const Mechanism *b, const double *off, double part, const double *forces) {
    const System *s = b->system;
    for (int k = 0; k < s->m; k++) {
        if (!b->linear.unique[k]) continue;
        for (int e = s->row_start[k]; e < s->row_start[k + 1]; e++) {
            const double most = mechanism_largest_alike(s, s->speed_dimension[s->entry_column[e]], forces);
            if (fabs(b->G[e] * off[k]) > part * fmax(most, fabs(b->G[e] * b->lambda[k]))) return 1;
        }
    }
    return 0;
}

static int all_unique(const Linear *l, int m) {
    for (int k = 0; k < m; k++)
        if (!l->unique[k]) return 0;
    return 1;
}

/* Are accelerations or multipliers of the start others than the sum, once forces at work are those of it?  Multipliers are
 * smooth along a branch, or, where something pushes out of it which they hold by 1 / angle of it, they are so times it. */
static int others(Solver *s, double t, double apart) {
    const System *x = s->system;
    Mechanism *b = &s->stepped;
    double *sum = s->part.crossing->sum, *vdot = sum + 2 * x->m, *forces = vdot + x->nv, *reach = forces + x->nv;
    double *y = s->part.crossing->y;
    mechanism_at_work(b, forces, reach);
    state_gather(x, s->state.q, s->state.v, y);
    if (add_motion(s, t, y, -1, sum) != OK) return 1;
    for (int i = 0; i < x->nv; i++)
        if (fabs(vdot[i]) > FORCES_LOST * mechanism_largest_alike(x, x->speed_dimension[i], reach)) return 1;
    if (!s->state.now.dependent && !all_unique(&b->linear, x->m)) return 0; /* in it; unique.* says so */
    return differ(b, sum, FORCES_LOST, forces) && differ(b, sum + x->m, FORCES_LOST * apart, forces);
}

static double *no_motion(Solver *s) {
    double *sum = s->part.crossing->sum;
    memset(sum, 0, (size_t)(2 * s->system->m + s->system->nv) * sizeof *sum);
    return sum;
}

/* Is the start another than what a polynomial through the motion beside says? */
static int turns(Solver *s, double t, double sizes, double apart) {
    double *sum = no_motion(s), *y = s->part.crossing->y;
    for (int i = BESIDES - 1; i >= 0; i--) /* the nearest last: forces are those there */
        if (go_beside(s, t, (i + 1) * sizes, y) != OK || add_motion(s, t, y, POLYNOMIAL[i], sum) != OK) return 1;
    return others(s, t, apart);
}

/* Is it another than where the rows cannot tell it from the start? */
static int doubtful(Solver *s, double t, double apart) {
    double *y = s->part.crossing->y;
    for (int i = 0; i < s->system->nv; i++) {
        for (int sign = -1; sign <= 1; sign += 2) {
            double *sum = no_motion(s);
            if (go_unseen(s, t, i, sign * ROUNDED, apart, y) != OK || add_motion(s, t, y, 1, sum) != OK) return 1;
            if (others(s, t, apart)) return 1;
        }
    }
    return 0;
}

/* Speeds that were completed are known there to eps / apart, and multipliers, which are what is left of their squares, to
 * eps / apart^3; those that were given on one branch may be right all the same.  What the motion is beside tells. */
static Status begins(Solver *s) {
    const double t = s->state.now.t;
    double *y = s->part.crossing->y, ahead, behind;
    Why rows = {""};
    state_gather(s->system, s->state.q, s->state.v, y);
    const double apart = rows_apart(s, t, y);
    if (!(apart >= 0 && apart < START_NEAR)) return OK;
    ahead = go_beside(s, t, START_BESIDE, y) == OK ? rows_apart(s, t, y) : -1;
    behind = go_beside(s, t, -START_BESIDE, y) == OK ? rows_apart(s, t, y) : -1;
    if (ahead >= 0 && behind >= 0 && !(fmax(ahead, behind) > OPENS * apart)) return OK; /* they stay as they are */
    if (!turns(s, t, behind > ahead ? -START_BESIDE : START_BESIDE, apart) || !doubtful(s, t, apart)) return OK;
    s->why = (Why){""};
    state_gather(s->system, s->state.q, s->state.v, y);
    if (crossing_factor(s, t, y, CROSSING_NAMING) != OK) return FAILED;
    (void)crossing_name_rows(s, &rows);
    return fail(&s->why,
                "next to these start values the configuration is singular: the constraints %s depend on each other, "
                "another branch of the motion begins, and multipliers have lost their digits (the sine of the angle "
                "between the rows is %.3g, 0.01 is enough): start further beside it, or give the speeds of one branch",
                rows.text, apart);
}

SHARED_VALUE const Crossing CROSSING = {crossing_layout, begins};

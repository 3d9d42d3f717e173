/* mechanism.h -- a system with the memory that its evaluation needs: values at a state,
 * accelerations and multipliers, and the projection onto the constraints.  One for the coordinates
 * that are stepped, and one for the full coordinates of an embedding. */
#ifndef LAGFMU_MECHANISM_H
#define LAGFMU_MECHANISM_H

#include "arena.h"
#include "kinematics.h"
#include "linear.h"
#include "linkage.h"
#include "status.h"
#include "system.h"

#include <math.h>
#include <string.h>

/* How a friction stands.  sign: N = sign (load + c lambda) while it slips; direction: unit vector of the
 * slip velocity where that is zero or was last known; slip velocities up to `noise` are rounding.  held: it does
 * not stick, but what does leaves it no slip, as in a mechanism that stands. */
typedef struct {
    int sticks, held;
    double sign, direction[2], noise;
} StickSlip;

struct FrictionForces;
typedef struct Mechanism Mechanism;

/* A time [s] with the inputs and parameters then. */
typedef struct {
    double t;
    const double *u, *p;
} Instant;

/* What friction adds (friction.h). */
typedef struct {
    void (*layout)(Mechanism *b, Arena *arena);
    /* (m) `active` with the rows that stick by friction */
    const int *(*acting)(Mechanism *b, const int *active);
    Status (*motion)(Mechanism *b, Instant at, const double *q, const double *v, const int *active);
    /* what frictions do under multipliers that are given, of which vdot has come out */
    Status (*given)(Mechanism *b, Instant at, const double *q, const double *v, const int *active);
    /* 0: the normal force of friction i is not the only one with the latest motion */
    int (*unique_normal)(Mechanism *b, int i);
} Sliding;

struct Mechanism {
    const System *system;
    Linear linear;
    double *M, *F, *G, *nu, *gamma; /* values at the state that was evaluated last */
    double *B, *drift;              /* of q' = B v + b, the same; with them, for kinematics.c: */
    int *column_start, *column_rate; /* (nv + 1), (rates) where the values of each speed stand in the list of B */
    int *is_unwrapped;              /* (nq) */
    double *angle;                  /* (unwrapped_count) scratch */
    double *vdot, *lambda;          /* of the latest motion(): (nv), (m) */
    unsigned long evaluations;      /* how many there have been: whether a motion is still the latest */
    double *f;                      /* (m) scratch for residuals */
    double *terms;                  /* (m) of mechanism_terms() */
    double *dq, *trial, *nearer;    /* (nv), (nq), (nq) scratch of project(): what moves, q where it is tried, q before */
    double *reach, *place;          /* (nv) scratch: mechanism_reach() and mechanism_place() of all, or at_work() */
    int *fixed;                     /* (m) scratch of project(): position constraints that act, with */
    int *pulls;                     /* (m) those of the basis among them */
    int dependent;                  /* 1: rows that act depend on each other, on the constraints */
    const int *basis;               /* (m) those that stood for all at the latest state on them; NULL: not known */
    const double *given;            /* (m) multipliers that somebody else solves for; NULL: motion() does */
    int *none;                      /* (m) no row acts */
    int stage;                      /* 1: of motion(), the accelerations alone are asked for */
    Why *why;
    const Sliding *sliding;     /* NULL without frictions */
    struct FrictionForces *friction; /* what `sliding` works with */
};

/* `sliding`: what a system with frictions needs, not used without. */
SHARED void mechanism_layout(Mechanism *b, Arena *arena, const System *s, Why *why,
                             const Sliding *sliding);

/* What a method needs that steps the mechanism itself: the rows that act, on f = offset (m; NULL: on f = 0); inputs, held
 * during the step, and parameters. */
typedef struct {
    Mechanism *b;
    const int *active;
    const double *offset, *u, *p;
} Acting;

/* sum_j G_kj x_j for the row k of the G that was evaluated last. */
static inline double mechanism_row(const Mechanism *b, int k, const double *x) {
    const System *s = b->system;
    double sum = 0;
    for (int e = s->row_start[k]; e < s->row_start[k + 1]; e++)
        sum += b->G[e] * x[s->entry_column[e]];
    return sum;
}

/* G_k^T part, added to the force (nv). */
static inline void mechanism_push(const Mechanism *b, int k, double part, double *force) {
    const System *s = b->system;
    for (int e = s->row_start[k]; e < s->row_start[k + 1]; e++) force[s->entry_column[e]] += part * b->G[e];
}

/* G v - nu of row k at the state that was evaluated last. */
static inline double mechanism_slip(const Mechanism *b, int k, const double *v) {
    return mechanism_row(b, k, v) - b->nu[k];
}

/* sum_j |G_kj| |x_j|: the size of the terms of mechanism_row(). */
static inline double mechanism_row_size(const Mechanism *b, int k, const double *x) {
    const System *s = b->system;
    double sum = 0;
    for (int e = s->row_start[k]; e < s->row_start[k + 1]; e++)
        sum += fabs(b->G[e] * x[s->entry_column[e]]);
    return sum;
}

/* B and b at q; what the four below take. */
static inline void mechanism_kinematics(Mechanism *b, Instant at, const double *q) {
    if (b->system->kinematics != NULL) KINEMATICS->evaluate(b, at.t, q, at.u, at.p);
}

/* q' (nq) = B v + b. */
static inline void mechanism_rates(const Mechanism *b, const double *v, double *rate) {
    if (b->system->kinematics != NULL)
        KINEMATICS->rates(b, v, rate);
    else
        memcpy(rate, v, (size_t)b->system->nq * sizeof *rate);
}

/* q (nq) <- q + part B w. */
static inline void mechanism_move(const Mechanism *b, double part, const double *w, double *q) {
    if (b->system->kinematics != NULL)
        KINEMATICS->move(b, part, w, q);
    else
        for (int j = 0; j < b->system->nq; j++) q[j] += part * w[j];
}

/* The displacement along speed i that moves coordinates by x (nq) of theirs. */
static inline double mechanism_reach(const Mechanism *b, const double *x, int i) {
    return b->system->kinematics != NULL ? KINEMATICS->reach(b, x, i, 1) : fabs(x[i]);
}

/* The same without turns that angles have made. */
static inline double mechanism_place(const Mechanism *b, const double *x, int i) {
    return b->system->kinematics != NULL ? KINEMATICS->reach(b, x, i, 0) : fabs(x[i]);
}

/* Unit quaternions of norm 1, angles on what they equal modulo 2 pi.  FAILED: a quaternion is no rotation. */
static inline Status mechanism_settle(const Mechanism *b, Instant at, double *q) {
    return b->system->kinematics != NULL ? KINEMATICS->settle(b, at.t, q, at.u, at.p) : OK;
}

/* A change (nq) of coordinates turns unit quaternions, and does nothing else to them. */
static inline void mechanism_settle_change(const Mechanism *b, const double *q, double *dq) {
    if (b->system->kinematics != NULL) KINEMATICS->settle_change(b, q, dq);
}

/* M, F, G, nu, gamma, B, b at a state.  FAILED if one is not finite. */
SHARED Status mechanism_evaluate(Mechanism *b, Instant at, const double *q, const double *v);

/* x^T M x, by the M that was evaluated last. */
SHARED double mechanism_square(const Mechanism *b, const double *x);

/* f (m).  FAILED if one is not finite. */
SHARED Status mechanism_residual(Mechanism *b, Instant at, const double *q, double *f);

/* b->terms (m): the largest magnitude among the terms of each f, of which f is rounding; 0 where there is none. */
SHARED void mechanism_terms(Mechanism *b, Instant at, const double *q);

/* evaluate, factor, solve: b->vdot (nv) and b->lambda (m), 0 where a row does not act.  Where multipliers are given
 * M vdot = F + G^T lambda alone, whatever rows act. */
SHARED Status mechanism_motion(Mechanism *b, Instant at, const double *q, const double *v,
                               const int *active);

/* The same by the rows of the basis alone, for a state on the constraints: where the others agree with what comes
 * out it is the motion by all of them.  0: they do not, or the basis does not do here. */
SHARED int mechanism_motion_kept(Mechanism *b, Instant at, const double *q, const double *v, const int *active);

/* The same for a state off the constraints: what depends on each other on them does so here, and is not
 * asked to agree.  `offset` (m), `span` (nv) as below. */
SHARED Status mechanism_motion_near(Mechanism *b, Instant at, const double *q, const double *v,
                                    const int *active, const double *offset, const double *span);

/* Of the latest motion, for each speed all forces at work (nv), those of constraint included, and its
 * acceleration, or the one that these could give it if they did not balance: what |vdot| is the rounding of. */
SHARED void mechanism_at_work(const Mechanism *b, double *forces, double *reach);

/* The largest magnitude of x (nv) among the speeds of a dimension. */
SHARED double mechanism_largest_alike(const System *s, int dimension, const double *x);

/* shared (nv): what speeds a whole motion has that moves each coordinate at `speed` (nv): the largest of
 * its dimension; and, across dimensions, with the kinetic energy of the fastest for the heaviest of its
 * own.  A coordinate may rest only because others, which move, hold it: what rounding leaves of its speed
 * is rounding of theirs.  Of the masses that were evaluated last. */
SHARED void mechanism_motion_speeds(const Mechanism *b, const double *speed, double *shared);

/* The nearest state, in the metric of M, with f = offset and G v = nu on the rows that act; q and
 * v are moved in place.  For states that are nearly consistent; initialization.c deals with the others.
 * `span` (nv) are the magnitudes of what each speed moves, which say what rounding is.  On failure q and v are
 * untouched. */
SHARED Status mechanism_project(Mechanism *b, Instant at, double *q, double *v, const int *active,
                                const double *offset, const double *span);

#endif

/* mechanism.h -- a system with the memory that its evaluation needs: values at a state,
 * accelerations and multipliers, and the projection onto the constraints.  One for the coordinates
 * that are stepped, and one for the full coordinates of an embedding. */
#ifndef LAGFMU_MECHANISM_H
#define LAGFMU_MECHANISM_H

#include "arena.h"
#include "linear.h"
#include "linkage.h"
#include "status.h"
#include "system.h"

#include <math.h>

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
    /* 0: the normal force of friction i is not the only one with the latest motion */
    int (*unique_normal)(Mechanism *b, int i);
} Sliding;

struct Mechanism {
    const System *system;
    Linear linear;
    double *M, *F, *G, *nu, *gamma; /* values at the state that was evaluated last */
    double *vdot, *lambda;          /* of the latest motion(): (nv), (m) */
    double *f;                      /* (m) scratch for residuals */
    double *dq, *trial;             /* (nv), (nq) scratch of project(): what moves, q where it is tried */
    int *fixed;                     /* (m) scratch of project(): position constraints that act */
    int dependent;                  /* 1: rows that act depend on each other, on the constraints */
    int stage;                      /* 1: of motion(), the accelerations alone are asked for */
    Why *why;
    const Sliding *sliding;     /* NULL without frictions */
    struct FrictionForces *friction; /* what `sliding` works with */
};

/* `sliding`: what a system with frictions needs, not used without. */
SHARED void mechanism_layout(Mechanism *b, Arena *arena, const System *s, Why *why,
                             const Sliding *sliding);

/* sum_j G_kj x_j for the row k of the G that was evaluated last. */
static inline double mechanism_row(const Mechanism *b, int k, const double *x) {
    const System *s = b->system;
    double sum = 0;
    for (int e = s->row_start[k]; e < s->row_start[k + 1]; e++)
        sum += b->G[e] * x[s->entry_column[e]];
    return sum;
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

/* M, F, G, nu, gamma at a state.  FAILED if one is not finite. */
SHARED Status mechanism_evaluate(Mechanism *b, Instant at, const double *q, const double *v);

/* f (m).  FAILED if one is not finite. */
SHARED Status mechanism_residual(Mechanism *b, Instant at, const double *q, double *f);

/* evaluate, factor, solve: b->vdot (nv) and b->lambda (m), 0 where a row does not act. */
SHARED Status mechanism_motion(Mechanism *b, Instant at, const double *q, const double *v,
                               const int *active);

/* The same for a state off the constraints: what depends on each other on them does so here, and is not
 * asked to agree.  `offset` (m), `size` (nq) as below. */
SHARED Status mechanism_motion_near(Mechanism *b, Instant at, const double *q, const double *v,
                                    const int *active, const double *offset, const double *size);

/* Of the latest motion, for each speed all forces at work (nv), those of constraint included, and its
 * acceleration, or the one that these could give it if they did not balance: what |vdot| is the rounding of. */
SHARED void mechanism_at_work(const Mechanism *b, double *forces, double *reach);

/* The nearest state, in the metric of M, with f = offset and G v = nu on the rows that act; q and
 * v are moved in place.  For states that are nearly consistent; initialization.c deals with the others.
 * `size` (nq) are the coordinates' magnitudes, which say what rounding is.  On failure q and v are
 * untouched. */
SHARED Status mechanism_project(Mechanism *b, Instant at, double *q, double *v, const int *active,
                                const double *offset, const double *size);

#endif

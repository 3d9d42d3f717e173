/* adjoint.h -- the derivatives of one sum of weighted variables by everything that they depend on, at once.
 *
 * Backwards through what sensitivity.c does forwards (Griewank & Walther, Evaluating Derivatives, 2008, ch. 3): each
 * array of changes in a Sensitivity holds what the sum changes by with them, their weights.  From those of variables
 * follow those of accelerations and multipliers, from these (one transposed solve) those of M, F, G, ..., and from these
 * those of the state, of the inputs and of time. */
#ifndef LAGFMU_ADJOINT_H
#define LAGFMU_ADJOINT_H

#include "linkage.h"
#include "outputs.h"
#include "sensitivity.h"

/* Of a system's tangents, for each of their columns (t, q, v, u, of outputs vdot, lambda, Q too) the number of its group:
 * no result depends on two columns of a group (Curtis, Powell & Reid 1974), but for the energies, which depend on all.
 * NULL: each is one by itself. */
typedef struct Adjoint {
    const int *motion, *unwrapped, *outputs, *embed; /* motion: of `tangent` and `kinematics_tangent` */
    const struct Adjoint *full;                      /* of the system of all coordinates */
} Adjoint;

SHARED const Adjoint *const MODEL_ADJOINT; /* of model.c; NULL in an FMU without derivatives */

/* Neighbouring columns or results of a tangent: their changes along a direction, their gradients or weights. */
typedef struct {
    double *change, *weight;
    int count;
} Block;

enum { COLUMN_BLOCKS = 7, RESULT_BLOCKS = 11 };

/* One direction with what changes along it, in a system and in that of all coordinates; the results of a tangent along it;
 * where the gradients are by the columns of a group. */
typedef struct {
    Sensitivity stepped, full;
    double *first, **member;
} Directions;

/* A system at its latest motion. */
typedef struct {
    const System *system;
    const Adjoint *of;
    Sensitivity *weights, *along;
    Directions *in;
    Instant at;
    Observed *seen; /* NULL where its outputs are not of this system */
    const double *q, *v;
    double time; /* its change */
    Block column[COLUMN_BLOCKS], result[RESULT_BLOCKS];
} Backward;

SHARED void adjoint_layout(Directions *in, Arena *arena, const System *s);

/* All weights 0; the gradients by time and inputs, to which the system of all coordinates adds too, in dt and du. */
SHARED void adjoint_begin(Backward *x, double *dt, double *du);

/* The weights of variables, but those of single outputs, which are in w->down. */
SHARED void adjoint_weigh_share(Sensitivity *w, const Mechanism *b, int e, double weight);
SHARED void adjoint_weigh_slip(Sensitivity *w, const Mechanism *b, int k, double weight, const double *v);
SHARED void adjoint_weigh_acceleration(Sensitivity *w, const Mechanism *b, int k, double weight);

/* Backwards from these to those of q, v, inputs and time, through the latest motion of `b`, NULL where nothing is solved
 * for.  Behind it w->dgiven holds the weights of multipliers that are given. */
SHARED Status adjoint_back(Backward *x, Mechanism *b);

/* Backwards from q and v of all coordinates to those that are stepped. */
SHARED void adjoint_embed(Backward *x, const Backward *full);

/* Behind that, what is left of w->dq where the states that are set are settled: as kinematics.h's settle_along(). */
SHARED void adjoint_settle(Backward *x, Mechanism *b);

#endif

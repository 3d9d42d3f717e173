/* sensitivity.h -- how accelerations, multipliers and forces change when the state moves. */
#ifndef LAGFMU_SENSITIVITY_H
#define LAGFMU_SENSITIVITY_H

#include "arena.h"
#include "linkage.h"
#include "mechanism.h"

/* A direction: the change of time, coordinates (nq), speeds (nv), inputs and parameters. */
typedef struct {
    double dt;
    const double *dq, *dv, *du, *dp;
} Direction;

/* The changes along it, and the memory that is needed to find them. */
typedef struct Sensitivity {
    double *dM, *dF, *dG, *dnu, *dgamma, *df, denergy[2];
    double *dvdot, *dlambda; /* (nv), (m) */
    double *dB, *drate;      /* (rates), (nq) of q' = B v + b */
    double *b, *c;           /* (nv), (m) right sides */
    double *dq, *dv, *du;    /* (nq), (nv), (inputs): a direction, for whoever asks */
    double *dp;              /* (parameters) 0, but where a run's derivatives are taken */
    double *dforce;          /* (nv) change of Q */
    double *down, *dother;   /* (output_count) changes of these */
    double *dgiven;          /* (m) change of multipliers that are given; read where they are */
    double *known;           /* (m) dlambda where it is unique, no numbers elsewhere */
    /* Of frictions: what `slide` does in the place of one solve, and its memory. */
    Status (*slide)(struct Sensitivity *w, Mechanism *b, Instant at, const double *q, const double *v, Direction d);
    double *dmu, *dpart_load, *dpart_c; /* (2 frictions), (normal_parts), (normal_rows) */
    double *dpush;                      /* (2 frictions) of tangential multipliers, with their normal forces held */
    double *dslip, *dmargin, *dpower, *dnormal; /* (2 frictions), (frictions); found where more is asked than a stage needs */
} Sensitivity;

SHARED void sensitivity_layout(Sensitivity *w, Arena *arena, const System *s);

/* Changes along a direction of everything that `mechanism_motion` found at (at, q, v), which must be
 * the latest that was done with `b`. */
typedef Status Differentiate(Sensitivity *w, Mechanism *b, Instant at, const double *q, const double *v, Direction d);
SHARED Differentiate sensitivity_along;

/* The right sides b and c alone. */
SHARED void sensitivity_sides(Sensitivity *w, Mechanism *b, Instant at, const double *q, const double *v,
                              Direction d);

/* sliding_along.c: the same with frictions that slip or stick as they do there, from b and c. */
SHARED Differentiate sliding_along;

/* Changes of M, F, G, nu, gamma, f and the energies along a direction; nothing is solved. */
SHARED void sensitivity_of_values(Sensitivity *w, const System *s, Instant at, const double *q,
                                    const double *v, Direction d);

/* The change of the share that G's value e has in Q = G^T lambda. */
static inline double sensitivity_share(const Sensitivity *w, const Mechanism *b, int e) {
    const int k = b->system->entry_row[e];
    return w->dG[e] * b->lambda[k] + b->G[e] * w->dlambda[k];
}

/* The change of row k's G v - nu, and of its G vdot - gamma, by the dvdot that was found. */
SHARED double sensitivity_slip(const Sensitivity *w, const Mechanism *b, int k, const double *v, const double *dv);
static inline double sensitivity_acceleration(const Sensitivity *w, const Mechanism *b, int k) {
    return mechanism_row(b, k, w->dvdot) - w->c[k];
}

/* The change of row k's residual: df, or of G v - nu for a nonholonomic row. */
SHARED double sensitivity_residual(const Sensitivity *w, const Mechanism *b, int k, const double *v,
                                   const double *dv);

/* J = d(y')/dy (ny * ny, row by row) and d(y')/dt (ny) for y = [q; v], y' = [v; vdot], with the inputs
 * held and the rows in `active` acting. */
SHARED Status sensitivity_jacobian(Sensitivity *w, Mechanism *b, Instant at, const int *active,
                                   const double *y, double *J, double *dfdt);

#endif

/* adjoint.h -- the derivatives of one sum of weighted variables by everything that they depend on, at once.
 *
 * Backwards through what sensitivity.c does forwards (reverse mode; Griewank & Walther, Evaluating Derivatives, 2008,
 * ch. 3): each array of changes in a Sensitivity holds what the sum changes by with them, their weights.  From those of
 * variables follow those of accelerations and multipliers, from these (one transposed solve) those of M, F, G, ..., and
 * from these those of the state, of the inputs and of time. */
#ifndef LAGFMU_ADJOINT_H
#define LAGFMU_ADJOINT_H

#include "linkage.h"
#include "outputs.h"
#include "sensitivity.h"

/* Of a system's functions: each adds, to what is there, the gradient of the sum of its weighted (w) results. */
typedef struct Adjoint {
    void (*equations)(double t, const double *q, const double *v, const double *u, const double *p, const double *wM,
                      const double *wF, const double *wG, const double *wnu, const double *wgamma, const double *wf,
                      const double *wenergy, double *gt, double *gq, double *gv, double *gu);
    void (*kinematics)(double t, const double *q, const double *u, const double *p, const double *wrates,
                       const double *wdrift, double *gt, double *gq, double *gu);
    void (*unwrapped)(double t, const double *q, const double *u, const double *p, const double *wangle, double *gt,
                      double *gq, double *gu);
    void (*outputs)(double t, const double *q, const double *v, const double *u, const double *p, const double *vdot,
                    const double *lambda, const double *Q, const double *ww, const double *wother, double *gt,
                    double *gq, double *gv, double *gu, double *gvdot, double *glambda, double *gQ);
    void (*embed)(double t, const double *s, const double *sdot, const double *u, const double *p, const double *wq,
                  const double *wv, double *gt, double *gs, double *gsdot, double *gu);
    const struct Adjoint *full; /* of the system of all coordinates */
} Adjoint;

SHARED const Adjoint *const MODEL_ADJOINT; /* of model.c; NULL in an FMU without derivatives */

SHARED void adjoint_clear(Sensitivity *w, const System *s);

/* The weights of variables, but those of single outputs, which are in w->down. */
SHARED void adjoint_weigh_share(Sensitivity *w, const Mechanism *b, int e, double weight);
SHARED void adjoint_weigh_slip(Sensitivity *w, const Mechanism *b, int k, double weight, const double *v);
SHARED void adjoint_weigh_acceleration(Sensitivity *w, const Mechanism *b, int k, double weight);

/* Backwards from these to w->dq, w->dv, du (inputs) and *dt, through the latest motion of `b`, NULL where nothing is
 * solved for.  Behind it w->dgiven holds the weights of multipliers that are given. */
SHARED Status adjoint_back(Sensitivity *w, Mechanism *b, const System *s, const Adjoint *of, Instant at, Observed *o,
                           const double *q, const double *v, double *dt, double *du);

/* Behind that, what is left of w->dq where the states that are set are settled: as kinematics.h's settle_along(). */
SHARED void adjoint_settle(Sensitivity *w, Mechanism *b, const Adjoint *of, Instant at, const double *q, double *dt);

#endif

/* friction_events.h -- which frictions stick and which slip, and what is watched until that changes.
 *
 * At s = 0 a friction sticks if the sticking solution lies within its cone, |lambda_t| <= mu_s N.  If not, it
 * slips in the direction in which it begins to move under the force of that very slip: s/|s| = s'/|s'| with
 * s' = G_t vdot - gamma_t of the equations of sliding (Pfeiffer & Glocker 1996, chs. 5 and 6).
 *
 * All of it is reached by one pointer (optional.h), NULL in an FMU without frictions. */
#ifndef LAGFMU_FRICTION_EVENTS_H
#define LAGFMU_FRICTION_EVENTS_H

#include "impact.h"
#include "indicators.h"
#include "linkage.h"
#include "solver.h"

typedef struct {
    const Sliding *sliding;
    void (*layout)(Solver *s, Arena *scratch);
    /* The mechanism reads the modes of the state. */
    void (*attach)(Solver *s);
    /* At the start, with the contacts as they would be without frictions: all modes together. */
    Status (*begin)(Solver *s, Instant at, int *closed, const int *touching);
    /* At an event, `left` being the frictions' indicators: modes, offsets, starts of slipping. */
    Status (*change)(Solver *s, Instant at, const int *left, int *closed, const int *touching,
                     const int *departing);
    /* Where `left` says that a slip has ended, the state (q and v) is moved to where it is 0. */
    Status (*stop)(Solver *s, Instant at, const int *left);
    /* What of each friction the forces of now contradict, in `left` (2 frictions) as at an event; of the latest
     * motion.  `any`: 1 if something is. */
    Status (*contradicted)(Solver *s, Instant at, int *left, int *any);
    /* Frictions that stuck, and of which an input has moved the surface away, slip. */
    Status (*renew)(Solver *s);
    /* The same where motions jump: `carry` takes along what constraints hold, and what only sticks slips. */
    Status (*slip_off)(Solver *s, Status (*carry)(Solver *s));
    /* Two indicators a friction, of the latest motion, and their ranges. */
    void (*indicators)(const Solver *s, double *values);
    Range (*range)(const Solver *s, int which);
    /* 1: a direction of slip changes within a step, as two rows slip. */
    int (*turns)(const Solver *s);
    /* Directions of slip at the end of a step (t, y). */
    Status (*turn)(Solver *s, double t, const double *y);
    /* What frictions do, of the latest motion. */
    void (*observe)(const Solver *s, Observed *o);
    /* - sum lambda_t . s [W], of the latest motion. */
    double (*power)(const Solver *s);
    /* - int sum lambda_t . s dt [J] from t0 to t1, by the integrator's dense output. */
    Status (*work)(Solver *s, double t0, double t1, double *work);
    /* d(y')/dy and dy'/dt by differences. */
    Status (*jacobian)(Solver *s, double t, const double *y, double *J, double *dfdt);
    /* An impact with friction, and one without rebound; done: 0 where no contact that is struck is of a
     * normal force, or none was found (frictional_impact.c). */
    Status (*impact)(Solver *s, Instant at, const double *q, const double *v, const int *entering,
                  const double *slip, double *e, Impulse plastic, Impulse found, int *done);
} FrictionEvents;

/* Workspace of frictional_impact.c, and its function. */
SHARED size_t frictional_impact_doubles(const System *s);
SHARED size_t frictional_impact_ints(const System *s);
SHARED Status frictional_impact(Solver *s, Instant at, const double *q, const double *v, const int *entering,
                      const double *slip, double *e, Impulse plastic, Impulse found, int *done);

SHARED const FrictionEvents FRICTION_EVENTS;

#endif

/* impact.h -- impacts: all contacts that are struck at one instant are solved together. */
#ifndef LAGFMU_IMPACT_H
#define LAGFMU_IMPACT_H

#include "complementarity.h"
#include "linkage.h"
#include "solver.h"

static const double IMPACT_PULL = 1e-9; /* of the largest impulse: a negative one that is rounding */

/* Doubles and ints of workspace for n coordinates, m rows and so many contacts. */
static inline int impact_doubles(int n, int m, int contacts) {
    return 3 * n + 6 * m + contacts * contacts + 3 * contacts + complementarity_doubles(contacts);
}
static inline int impact_ints(int m, int contacts) {
    return m + 4 * contacts + complementarity_ints(contacts);
}

/* The velocities' change (nv) and the impulses (m). */
typedef struct {
    double *dv, *Lambda;
} Impulse;

/* All impacts of an instant; v (nv) is replaced by the velocities after them.  `touching`: flags, the
 * contacts that an impact can reach; `slow` (m): speeds that count as none; `dead`: flags, contacts that do not rebound;
 * `struck`: flags, set for the contacts that took an impulse, which is in s->part.contacts->push.  FAILED: no velocities satisfy the
 * contacts. */
SHARED Status impacts(Solver *s, Instant at, const double *q, double *v, const int *touching, const double *slow,
                      const int *dead, int *struck);

/* One impact on the contacts flagged in `entering`, approached or at rest, together; `dead`: flags, those with e = 0; NULL: all.
 * Lambda (m): the impulses, 0 where a row did not act. */
SHARED Status impact(Solver *s, Instant at, const double *q, double *v, const int *entering, const int *dead,
                     double *Lambda);

/* A (count, count), symmetric to the bit: how a unit impulse on each of the rows moves them all, those that are
 * factored taken care of.  force (nv): scratch; zero (m): 0. */
SHARED Status impact_compliance(Mechanism *b, int count, const int *rows, double *force, const double *zero,
                                Impulse scratch, double *A);

/* FAILED if a coefficient of restitution is not between 0 and 1. */
SHARED Status impact_check(Solver *s);

#endif

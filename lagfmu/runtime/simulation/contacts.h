/* contacts.h -- which contacts are closed. */
#ifndef LAGFMU_CONTACTS_H
#define LAGFMU_CONTACTS_H

#include "linkage.h"
#include "solver.h"

/* Modes, one a contact, with lambda > 0 where closed and d2f/dt2 >= 0 where open and touching.
 * `closed` is the first guess and is replaced.  `touching`, `departing`: flags, one a contact; one
 * departs right now because its multiplier passed through zero: there f and its first two
 * derivatives vanish, and the sign of what rounding leaves of them must not close it again.
 * `departing` may be NULL.  FAILED: no modes fit; `closed` is untouched. */
SHARED Status contacts_modes(Solver *s, Instant at, const double *q, const double *v, int *closed,
                             const int *touching, const int *departing);

#endif

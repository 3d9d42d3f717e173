/* rest.h -- frictions at s = 0, settled together: which stick, and which way the others begin to slip. */
#ifndef LAGFMU_REST_H
#define LAGFMU_REST_H

#include "friction.h"
#include "linkage.h"
#include "solver.h"

/* Frictions at s = 0, settled together; contacts as in `active`. */
typedef struct {
    Solver *s;
    Instant at;
    const int *active;
    Slide *slides;        /* trial modes, those that b->friction looks at meanwhile */
    int *resting, *sticking, *begins;
    double *guess;        /* (2 frictions) directions in which each would begin to slip */
} Rest;

/* Trial modes as the state's own; the mechanism looks at them until rest_finish. */
SHARED Rest rest_of(Solver *s, Instant at);

/* The modes of frictions and contacts together, from those in x->slides and `closed`; `ended` (frictions; NULL:
 * none) stopped slipping just now.  FAILED where the laws have no solution, or several (Painleve). */
SHARED Status rest_settle(Rest *x, int *closed, const int *ended, const int *touching, const int *leaving);

/* Does friction i, which slips at s = 0, go the way in which it begins to move?  Contacts as in s->active. */
SHARED Status rest_agrees(Rest *x, int i, int *agrees);

/* Back to the state's own modes, which are now those of x if `settled`. */
SHARED Status rest_finish(Rest *x, Status settled);

/* What of each slip velocity is rounding: of motions of this speed (n), of the motion as it is and was; it
 * never becomes less. */
SHARED void rest_set_noise(Solver *s, const double *speed, Slide *slides);
SHARED void rest_renew_noise(Solver *s, Slide *slides);

/* Slipping along v's slip velocity, where that is not rounding. */
SHARED void rest_slide_along(const Mechanism *b, int i, const double *v, Slide *slide);

#endif

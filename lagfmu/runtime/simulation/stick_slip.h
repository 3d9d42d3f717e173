/* stick_slip.h -- frictions at s = 0, settled together: which stick, and which way the others begin to slip. */
#ifndef LAGFMU_STICK_SLIP_H
#define LAGFMU_STICK_SLIP_H

#include "friction.h"
#include "linkage.h"
#include "solver.h"

static const double FRICTION_JUMP = 1e3; /* times the noise: a slip velocity that no rounding makes */

struct FrictionMemory {
    StickSlip *trial; /* (frictions) modes */
    double *work;     /* (2 frictions + 3 solver_width()) of stick_slip.c, slip.c and friction_events.c */
    int *flags;       /* (4 frictions + 2 contacts) */
    double *impact;   /* (frictional_impact_doubles()) of frictional_impact.c */
    int *struck;      /* (frictional_impact_ints()) */
};

/* Frictions at s = 0, settled together; contacts as in `active`. */
typedef struct {
    Solver *s;
    Instant at;
    const int *active;
    StickSlip *modes;     /* trial modes, those that b->friction looks at meanwhile */
    int *still, *sticking, *begins;
    double *guess;        /* (2 frictions) directions in which each would begin to slip */
} Settling;

/* Trial modes as the state's own; the mechanism looks at them until stick_slip_finish. */
SHARED Settling stick_slip_try(Solver *s, Instant at);

/* The modes of frictions and contacts together, from those in x->modes and `closed`; `ended` (frictions; NULL:
 * none) stopped slipping just now.  FAILED where the laws have no solution, or several (Painleve). */
SHARED Status stick_slip_settle(Settling *x, int *closed, const int *ended, const int *touching,
                                const int *departing);

/* Does friction i, which slips at s = 0, go the way in which it begins to move?  Contacts as in s->active. */
SHARED Status stick_slip_agrees(Settling *x, int i, int *agrees);

/* Back to the state's own modes, which are now those of x if `settled`. */
SHARED Status stick_slip_finish(Settling *x, Status settled);

/* What of each slip velocity is rounding: of motions of this speed (nv), of the motion as it is and was; it
 * never becomes less. */
SHARED void stick_slip_set_noise(Solver *s, const double *speed, StickSlip *modes);
SHARED void stick_slip_renew_noise(Solver *s, StickSlip *modes);

/* Slipping along v's slip velocity, where that is not rounding. */
SHARED void stick_slip_along(const Mechanism *b, int i, const double *v, StickSlip *mode);

#endif

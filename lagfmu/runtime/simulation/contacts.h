/* contacts.h -- what happens at contacts: which are closed (contacts.c), impacts (impact.c), rest and modes together
 * (modes.c), a state inside of them (landing.c).  Of contacts and of constraints that hold by friction. */
#ifndef LAGFMU_CONTACTS_H
#define LAGFMU_CONTACTS_H

#include "linkage.h"
#include "solver.h"

struct ContactMemory {
    double *forces, *reach; /* (nv) what acts on each speed; contacts.c and those of frictions */
    int *active, *modes;    /* (m), (2 contacts) of contacts.c */
    double *slow;           /* (m) of modes.c: speeds that count as none; ... */
    double *arriving;       /* (nv) ... before an impact; ... */
    int *flags;             /* (8 contacts) ... what is said of each */
    double *push;           /* (contacts) impulse of the impacts of the present instant [of lambda times s] */
    double *impact;         /* (impact_doubles()) of impact.c */
    int *struck;            /* (impact_ints()) */
    double *inside;         /* (2 nv + 2 m) of landing.c */
    int *acting;            /* (m) */
};

/* All of it is reached by one pointer (optional.h), NULL in an FMU without contacts and frictions; what its members do is
 * said in modes.h and impact.h. */
typedef struct {
    void (*layout)(Solver *s, Arena *scratch);
    Status (*check)(Solver *s);
    Status (*modes)(Solver *s, Instant at, const double *q, const double *v, int *closed, const int *touching,
                    const int *departing);
    Status (*pass)(Solver *s, const int *happened);
    Status (*departures)(Solver *s, double span, double drift);
    Status (*contradicted)(Solver *s);
    Status (*push_out)(Solver *s);
    Status (*bring_back)(Solver *s, const int *happened, const double *pull);
} Contacts;

SHARED const Contacts CONTACTS;

/* Modes, one a contact, with lambda > 0 where closed and d2f/dt2 >= 0 where open and touching.
 * `closed` is the first guess and is replaced.  `touching`, `departing`: flags, one a contact; one
 * departs right now because its multiplier passed through zero: there f and its first two
 * derivatives vanish, and the sign of what rounding leaves of them must not close it again.
 * `departing` may be NULL.  FAILED: no modes fit; `closed` is untouched. */
SHARED Status contacts_modes(Solver *s, Instant at, const double *q, const double *v, int *closed,
                             const int *touching, const int *departing);

#endif

/* observed.h -- what an importer can read at a state (observe.c): each array is a row of a table, from which come its member,
 * its memory, and how what is not finite in it is called. */
#ifndef LAGFMU_OBSERVED_H
#define LAGFMU_OBSERVED_H

#include "linkage.h"
#include "state.h"

/* What some values belong to. */
typedef enum {
    OF_NONE, OF_COORDINATE, OF_SPEED, OF_ACCELERATION, OF_FORCE, OF_STEPPED, OF_ROW, OF_ENTRY, OF_CONTACT, OF_SLIP,
    OF_FRICTION
} Owner;

/* Member, how many, what each belongs to, its name as the FMU has it; OF_NONE: never looked at.  `full`: the equations that
 * are read; `own`: those that are stepped, which are the same without an embedding; `stepped`: its coordinates, else 0. */
#define OBSERVED_NUMBERS(A)                                                                                          \
    A(q, full->nq, OF_COORDINATE, "%s")                                                                              \
    A(v, full->nv, OF_SPEED, "%s%s%s")                                                                               \
    A(rate, full->kinematics != NULL ? full->nq : 0, OF_COORDINATE, "der(%s)") /* q' where it is not v */            \
    A(vdot, full->nv, OF_ACCELERATION, "%s%s%s")                                                                     \
    A(force, full->nv, OF_FORCE, "Q.%s")                                                                             \
    A(s, stepped, OF_STEPPED, "%s")                                                                                  \
    A(sdot, stepped, OF_STEPPED, "der(%s)")                                                                          \
    A(sddot, stepped, OF_STEPPED, "der(%s,2)")                                                                       \
    A(lambda, full->m, OF_ROW, "lambda.%s")                                                                          \
    A(residual, full->m, OF_ROW, "residual.%s")                                                                      \
    A(share, full->entries, OF_ENTRY, "Q.%s.%s")              /* one constraint's part of Q */                       \
    A(slip, 2 * own->frictions, OF_SLIP, "slip.%s")                                                                  \
    A(margin, own->frictions, OF_FRICTION, "margin.%s")                                                              \
    A(power, own->frictions, OF_FRICTION, "power.%s")                                                                \
    A(applied, full->nv, OF_NONE, "")                         /* F, of the unconstrained motion */                   \
    A(own, full->output_count, OF_NONE, "")                   /* the model's own; ... */                             \
    A(other, full->output_count, OF_NONE, "")                 /* ... where these are not finite */                   \
    A(work_unique, outputs_unique_doubles(full), OF_NONE, "") /* scratch, with own_unique */

#define OBSERVED_FLAGS(A)                                                                                            \
    A(unique, full->m, OF_ROW, "unique.%s")                                                                          \
    A(own_unique, full->unique_count, OF_NONE, "")                                                                   \
    A(sticks, own->frictions, OF_FRICTION, "sticks.%s")

#define OBSERVED_NUMBER(member, many, of, name) double *member;
#define OBSERVED_FLAG(member, many, of, name) int *member;
typedef struct {
    OBSERVED_NUMBERS(OBSERVED_NUMBER)
    OBSERVED_FLAGS(OBSERVED_FLAG)
    double energy[2];              /* kinetic, potential */
    double *latest_q[EVENT_KINDS], *latest_v[EVENT_KINDS]; /* of an embedding: state.latest in full coordinates */
    int asked;                     /* 1: own_unique is wanted, a solve for each */
} Observed;

SHARED void observed_layout(Observed *o, Arena *arena, const System *own);

#endif

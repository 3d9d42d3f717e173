/* initial_projection.h -- start values onto the constraints, by start priority (start_priority.h). */
#ifndef LAGFMU_INITIAL_PROJECTION_H
#define LAGFMU_INITIAL_PROJECTION_H

#include "linkage.h"
#include "solver.h"

/* The start of a simulation: the state that is being found, where it began, and who said that. */
typedef struct {
    Solver *s;
    Instant at;
    const double *q0, *v0;
    const Priority *priority_q, *moves; /* (nq), (nv) of coordinates, and of what moves them */
    const Priority *priority_v;         /* (nv) of the speeds */
} Start;

/* Of initialization.c, initial_projection.c and joint_start.c. */
struct StartMemory {
    Priority *moves; /* (nv) priority_moves() */
    double *work;    /* (6 nq + 3 m) */
    int *rows;       /* (2 m + contacts) */
};
SHARED void start_layout(Solver *s, Arena *scratch);

/* "the start is refused: " before the cause. */
SHARED Status initial_refused(Solver *s);

/* f = 0 on the rows: q (nq) is moved.  `rows` (m) loses those that are nonholonomic. */
SHARED Status initial_positions(const Start *x, double *q, int *rows);

/* initialization.c -- `moved` for each value of x->q0 and x->v0 that the state of the solver does not have. */
SHARED void initial_moved(const Start *x, Moved moved, void *context);

/* G v = nu at q on the rows: v (nv), from x->v0, as near as can be.  least (nv) >= 0: speeds below which
 * nothing counts. */
SHARED Status initial_velocities(const Start *x, const double *q, const double *least, const int *rows, double *v);

#endif

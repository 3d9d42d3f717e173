/* variation.h -- derivatives of a run by parameters and start values: columns S = dy/dp that go with the state.
 *
 *   y' = phi(t, y, p) ,  S' = phi_y S + phi_p        on the tangents of f = offset and G v = nu  (variation.c)
 *   at an event:  y+ = R(t, y-, p) and with it S+                                                (saltation.c)
 *
 * Besides y, a column holds the derivatives of all that a state remembers of events.  Where a derivative does not
 * exist the columns are 0 from there on, state.varied is 0, and it is said why.
 *
 * All of it is reached by one pointer (optional.h), NULL in an FMU of which no derivatives are asked. */
#ifndef LAGFMU_VARIATION_H
#define LAGFMU_VARIATION_H

#include "column.h"
#include "linkage.h"
#include "solver.h"

/* What is differentiated: it makes a state, or goes on from the one that stands there, with the parameters that
 * stand there.  A start moves the start value of column c, if it is one, by `part`. */
typedef Status (*Map)(Solver *s, void *context, int c, double part);

typedef struct {
    void (*layout)(Solver *s, Arena *scratch);
    /* Rates of the columns at y (solver_width()), of the latest motion. */
    void (*rates)(Solver *s, double t, const double *y, double *rates);
    /* After a step of `i`, and its dense output: columns that are no numbers end, and those that have ended in it are 0 in
     * all that is left of it. */
    void (*stepped)(Solver *s, Integrator *i);
    /* The columns behind y, which lies on the constraints, moved onto their tangents. */
    Status (*project)(Solver *s, Instant at, double *y);
    /* `map` starts the run (it has, when this is called): the columns there. */
    Status (*start)(Solver *s, Map map, void *context);
    /* Does what `map` does, at an event of the indicators in state.left, or at a given time: columns go with it. */
    Status (*pass)(Solver *s, Map map);
    Status (*jump)(Solver *s, Map map);
    /* The step just taken, not yet moved: the columns end where it went over a jump that is no event. */
    void (*look)(Solver *s);
    /* Why the columns ended, since it was last asked; empty where they did not. */
    const char *(*ended)(Solver *s, Why *text);
} Variation;

SHARED const Variation VARIATION;

/* saltation.c; the columns end, FAILED for a reason that stands in s->why, whose text is kept. */
SHARED void saltation_end(Solver *s);
SHARED void saltation_layout(Solver *s, Arena *scratch);
SHARED Status saltation_start(Solver *s, Map map, void *context);
SHARED Status saltation_pass(Solver *s, Map map);
SHARED Status saltation_jump(Solver *s, Map map);
SHARED const char *saltation_ended(Solver *s, Why *text);

/* acceleration_jump.c */
SHARED void acceleration_jump_look(Solver *s);

#endif

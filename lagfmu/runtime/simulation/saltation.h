/* saltation.h -- what saltation_state.c, saltation_differences.c and saltation.c share. */
#ifndef LAGFMU_SALTATION_H
#define LAGFMU_SALTATION_H

#include "linkage.h"
#include "variation.h"

struct Saltation {
    char *before, *after;            /* the state's block before and after the map */
    double *from, *direction;        /* (column_size()) what is kept, before the map, and a direction of it */
    double *change;                  /* (column_size()) */
    double *columns, *found;         /* all columns before and after the map */
    double *flow_before, *flow_after; /* (states) phi- and phi+, ... */
    double *turn;                    /* ... and how phi- changes with time */
    double *dt;                      /* (columns) of the event's time */
    double *there, *values, *slope, *bend; /* (states), (indicators) */
    double *level, *speed;           /* (indicators) at the event, and their rates there */
    int *passed;                     /* (indicators) whether the event passes it */
    int limit;                       /* of those that are passed the quickest; -1: no event */
    double pace;                     /* [1/s] the motion's natural rate; quicker where a limit is passed slowly */
    double *was, *modes, *others;    /* (saltation_modes_size()) before the map, after it, and beside that */
    Why ended;
};

/* A direction in t, y (states) and p[parameter] (-1: none), at the state whose y is `y`; ddy (states, or NULL): it
 * is a parabola. */
typedef struct {
    double dt;
    const double *y, *dy;
    int parameter;
    const double *ddy;
} Way;

/* d g along a way: sum of BESIDE_WEIGHT g(BESIDE_AT step) / step, of fourth order. */
enum { BESIDE_POINTS = 4 };
static const double BESIDE_AT[BESIDE_POINTS] = {-2, -1, 1, 2};
static const double BESIDE_WEIGHT[BESIDE_POINTS] = {1.0 / 12, -8.0 / 12, 8.0 / 12, -1.0 / 12};

/* The step for it, at which truncation and rounding are about 1e-12. */
SHARED double saltation_step(const Solver *s, Way way);

/* How large a parameter is; 1 for one that is 0, and for a start value (-1). */
SHARED double saltation_size(const Solver *s, int parameter);

/* What is known of a map: the state before it, from which it goes on unless it is a start. */
typedef struct {
    Map map;
    void *context;
    Numbers now;
    int start;
} Jump;

/* phi (states) at (t, y). */
SHARED Status saltation_flow(Solver *s, double t, const double *y, double *flow);

/* saltation_state.c: z (column_size()) of the state, and back. */
SHARED void saltation_gather(const Solver *s, double *z);
SHARED void saltation_scatter(Solver *s, const double *z);

/* How it stands, and, at the end, how often events have happened, in the order of a column. */
SHARED void saltation_modes(const Solver *s, double *modes);
SHARED int saltation_modes_size(const System *s);

/* saltation_differences.c: changes of the values at y, in s->sensitivity, along dy and p[parameter]. */
SHARED void saltation_values_along(Solver *s, Instant at, const double *y, const double *dy, int parameter);

/* x->slope and x->bend of the limits, which are x->level at time t, along a way. */
SHARED Status saltation_limits(Solver *s, double t, Way way);

/* x->change: how the map's state changes along x->direction, dt and the number of column c.  FAILED also where one of
 * the states comes out in other modes than x->modes. */
SHARED Status saltation_map(Solver *s, const Jump *jump, int c, double dt);

#endif

/* nominals.h -- what is large and what is small in a motion: sizes, natural rate, error scales. */
#ifndef LAGFMU_NOMINALS_H
#define LAGFMU_NOMINALS_H

#include "linkage.h"
#include "solver.h"

static const double STILL = 1e-100; /* scale of what neither moves nor is pushed: anything else exceeds it */

SHARED void nominals_layout(Solver *s, Arena *scratch);

/* least (nq): for each coordinate the largest parameter of its dimension that stands in its rows; 0 for an angle. */
SHARED void nominals_extents(const System *s, const double *p, double *least);

/* state.size and state.span at q; 0 where there is none.  Before: the sizes before q was projected, or 0. */
SHARED void nominals_sizes(Solver *s, Instant at, const double *q);

/* shared (states): state.scale, no smaller than the scales and magnitudes in y of the coordinates that each
 * one can turn into by another choice of axes: those of its dimension with which a constraint or the mass
 * matrix ties it; angles with which a constraint does.  So the steps are the same in whatever frame. */
SHARED void nominals_shared(const Solver *s, const double *y, double *shared);

/* Notes how far open contacts have been, and their largest terms there; stepped.f is f at q. */
SHARED void nominals_watch(Solver *s, Instant at, const double *q);

/* The gaps in which contacts touch, which only grow: roundings of the terms of f, and a part of the farthest that f
 * has been, or of its largest term there if that is less: so that bounces end. */
SHARED void nominals_gaps(Solver *s, Instant at, const double *q);

/* The speed [of f, per second] that the forces of the start give contact c on the way that it has been, or, if it has
 * never opened, in the sizes of what it holds.  Of the G that was evaluated last. */
SHARED double nominals_fall(const Solver *s, int c);

/* What y[j] is as large as: the size of a coordinate; of a speed that which forces give it within what
 * it moves, or the natural rate, if that is less or there are no forces. */
SHARED double nominals_natural(const Solver *s, int j);

/* 1 while a size, or the rate, is not known. */
SHARED int nominals_incomplete(const Solver *s);

/* Sizes, rate and scales as far as they can be known; scales only grow.  `stepped` holds the
 * motion at the state and instant; span [s]: of the first step, or 0 while there is none.  FAILED if one
 * is not finite. */
SHARED Status nominals_complete(Solver *s, Instant at, double span);

/* The motion's rate [1/s] in the step just taken, which inputs may have made another one than at the start;
 * never less than that. */
SHARED double nominals_pace(const Solver *s);

#endif

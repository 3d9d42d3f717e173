/* refinement.h -- x and lambda refined by what they leave of both equations, on the rows that act. */
#ifndef LAGFMU_REFINEMENT_H
#define LAGFMU_REFINEMENT_H

#include "linear.h"
#include "linkage.h"

SHARED void refinement_layout(Linear *l, Arena *arena);

/* Solves with right-hand sides b, c for x, lambda, by factors that are not exact. */
typedef void (*Substitute)(Linear *l, const double *b, const double *c, double *x, double *lambda);

/* Three steps of refinement in doubled precision of the solution x, lambda; b may be NULL (zero). */
SHARED void refine(Linear *l, Substitute substitute, const double *b, const double *c, double *x,
                   double *lambda);

/* One such step, in working precision unless `doubled`; before the first of these refine_begin(). */
SHARED void refine_begin(Linear *l);
SHARED void refine_once(Linear *l, Substitute substitute, int doubled, const double *b, const double *c,
                        double *x, double *lambda);

#endif

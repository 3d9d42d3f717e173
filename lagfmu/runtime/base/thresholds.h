/* thresholds.h -- what a start is decided by, when the FMU is built and when it runs: each value stands once.
 *
 * lagfmu/numeric/thresholds.py reads this file.  A threshold of the runtime alone stands where it is used. */
#ifndef LAGFMU_THRESHOLDS_H
#define LAGFMU_THRESHOLDS_H

#include <float.h>

/* ---- rank and consistency of the constraints ---- */
static const double RANK = 1e-12;         /* rows of unit norm that stand out by less are dependent, ... */
static const double RANK_TURNED = 1e2;    /* ... and by less than so many distances from the constraints, ... */
static const double RANK_LOOSEST = 1e-3;  /* ... which says nothing of rows at a larger angle */
static const double ON_CONSTRAINTS = 1e-13; /* a state that is closer is on them; relative to its size */
static const double CONSISTENT = 1e-7;    /* a dependent row may miss its right-hand side by this, relative */
static const double VANISHES = 1e-8;      /* component of a unit null vector that counts as zero */
static const double HIDDEN = 1e-7;        /* part that a heavy coordinate keeps in a row of unit norm, ... */
static const double HIDES = 1e-3;         /* ... of which it has at least this part without the masses: then rows
                                           * may seem to be dependent and are not */

/* ---- projection, and consistent initial values ---- */
enum { INITIAL_ITERATIONS = 60, INITIAL_SWEEPS = 3 }; /* of velocities: the second removes rounding of the first */
static const double INITIAL_NEAR = 1e-5; /* from here the angles between dependent rows tell how far off it is */
static const double INITIAL_ARRIVED = 1e3 * DBL_EPSILON; /* slip, relative to its terms, that rounding may leave */
static const double PRIORITY_EASE = 0x1p-15; /* weight of a start value's rank below those that a stage frees, ... */
static const double PRIORITY_GENTLY = 0.25;  /* ... and in the last stage, for values beyond reach */
static const double MOVED = 1e-12; /* of its size: a start value that has moved by more is told */
static const double PROJECTION_SMALL = 1e-12; /* residual of a projection, relative, that rounding may leave */
static const double LARGEST_ANGLE = 1e-3 * 0x1p52; /* [rad] neighbouring doubles are 1e-3 apart */
static const double SMALLEST_TOLERANCE = 1e-14; /* of a step, relative: less is rounding, ... */
static const double LARGEST_TOLERANCE = 0.1; /* ... and from 0.7 on steps go through contacts unseen */

/* ---- the motion's own sizes and times ---- */
static const double ROUNDINGS = 64; /* of its terms: |f| of a contact that touches, ... */
static const double TOUCH = 1e-9; /* ... or, of the farthest that it has been, what ends its bounces; of speeds: none */
static const double LOST = 1e3 * DBL_EPSILON; /* what projections leave of a place, or cancelling forces */
static const double DISPLACED = 0x1p-20; /* of a coordinate's size, to see what holds it, ... */
enum { LOTS = 64 }; /* ... in so many lots at most: every 64th is displaced at once */

/* ---- contacts and impacts ---- */
enum { CONTACTS_MOST = 12 };              /* contacts whose combinations are tried one by one */
static const double CONTACT_PULL = 1e-12; /* a multiplier this small, relative to the forces, is zero */

/* ---- friction ---- */
static const double FRICTION_SLACK = 1e-12; /* of the cone, and of slip velocities that rounding leaves */

#endif

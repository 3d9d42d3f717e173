/* thresholds.h -- what both engines decide by: each value stands once.
 *
 * The python engine reads this file (lagfmu/numeric/thresholds.py).  A threshold that only one of them has
 * stands where it is used. */
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
static const double LCP_ZERO = 1e-12;     /* of the terms of A z + b in scaled rows: a w that counts as none */
static const double LCP_DEPENDENT = 1e-10; /* of a row of unit norm that must stand out to join the set */

/* ---- projection, and consistent initial values ---- */
enum { PROJECTION_ITERATIONS = 10 };
static const double PROJECTION_SMALL = 1e-12; /* relative residual that rounding may leave */
static const double PROJECTION_ROUNDING = 100 * DBL_EPSILON; /* and where Newton's method that gains slowly
                                                              * is left in peace */
static const double PROJECTION_LINEAR = 0.1; /* ratio of successive errors: convergence is linear, G loses rank */
enum { INITIAL_ITERATIONS = 60, INITIAL_SWEEPS = 3 }; /* of velocities: the second removes rounding of the first */
static const double INITIAL_NEAR = 1e-5; /* from here the angles between dependent rows tell how far off it is */
static const double INITIAL_ARRIVED = 1e3 * DBL_EPSILON; /* slip, relative to its terms, that rounding may leave */
static const double PRIORITY_EASE = 0x1p-15; /* weight of a start value's rank below those that a stage frees */
static const double LARGEST_ANGLE = 1e-3 * 0x1p52; /* [rad] neighbouring doubles are 1e-3 apart */
static const double SMALLEST_TOLERANCE = 1e-14; /* of a step, relative: less is rounding, ... */
static const double LARGEST_TOLERANCE = 0.1; /* ... and from 0.7 on steps go through contacts unseen */

/* ---- the motion's own sizes and times ---- */
static const double TOUCH = 1e-9; /* |f| below this, in the constraint's own size, counts as touching */
static const double SLOW = 1e-9;  /* speed of a gap, relative to the motion's own, that counts as none */
static const double LOST = 1e3 * DBL_EPSILON; /* what projections leave of a place, or cancelling forces */
static const double MEASURED_PART = 1e-3; /* of the first step, in which a motion without scale is measured */
static const double DISPLACED = 0x1p-20; /* of a coordinate's size, to see what holds it */
static const double SHAKEN = 1e9; /* times the tolerance: roundings of q that an error of v may reach */
static const double STILL = 1e-100; /* scale of what neither moves nor is pushed: anything else exceeds it */

/* ---- steps ---- */
static const double FEWEST_STEPS_RK4 = 100; /* in one natural time of the motion, unless solver.step is set */
static const double FAR = 1e3, LEAST_FAR = 1e-6; /* how far a projection may move the state: times the
                                                  * tolerance, and at least, relative to the state */
static const double BALANCED = 1e3 * DBL_EPSILON; /* of what the forces alone would make of a step: what they
                                                   * leave of it where others hold the state still */
static const double HOPELESS = 1.0; /* error of one rk4 step, relative to the state: it means nothing */
enum { CHATTER = 200 };             /* events in next to no time after which the step is given up, ... */
static const double AT_ONCE = 1e-9; /* ... natural times that are next to none */
static const double PATIENCE = 200; /* steps after which a doStep is judged by its average step, ... */
static const double STEP_LIMIT = 1e7; /* ... and the steps that it may need in all */
static const double HEADWAY = 1e-6; /* natural times below which a step makes none */
static const double STABLE = 6.1;   /* h rho beyond which dop853 is unstable */
static const double SLOWER = 30;    /* rho / sigma, per price of a step, from which on the motion is slow */
static const double BOUND = 0.1;    /* h rho below which only the motion, or a bound, limits a step */
static const double STIFF_ROUNDING = 1e-14, STIFF_ROUNDING_FORCE = 1e-12; /* relative changes that say nothing */
enum {
    STIFF_EVERY = 3,  /* steps of dop853 of which one is judged while none was stiff */
    STIFF_STEPS = 15, /* steps that decide, ... */
    STIFF_OTHER = 6,  /* ... and others in a row after which they are counted anew */
    STIFF_BRIEF = 6,  /* steps of radau5 in a row that do not pay, after which dop853 comes back */
    STIFF_RETRY = 128 /* steps of radau5 before dop853 is tried again; twice as many each time */
};

/* ---- events ---- */
enum { SEARCH_FIRST = 4, SEARCH_MOST = 512, SEARCH_DIPS = 3 }; /* in a step; parabolas drawn through a dip */
static const double SEARCH_SMALLEST = 0x1p-30; /* of a step */
static const double SEARCH_SHALLOW = 0.1;      /* of the samples, how low a dip must go to be looked into */
static const double SEARCH_COARSE = 0x1p-5; /* of a step: as near as is looked where no rate is known */
static const double SEARCH_FINE = 0x1p-6;   /* of a step: near enough to take the one event that is seen */
enum { RATES_KEPT = 4 };                   /* points of a cubic polynomial through an estimated input */
static const double RATES_ROUNDING = 1e-9; /* of a communication step */

/* ---- contacts and impacts ---- */
enum { CONTACTS_MOST = 12 };              /* contacts whose combinations are tried one by one */
static const double CONTACT_PULL = 1e-12; /* a multiplier this small, relative to the forces, is zero */
enum { IMPACT_ROUNDS = 1000 }; /* at one instant, after which the rest is one plastic impact */
static const double IMPACT_ROUNDING = 1e-14; /* of the terms of a speed: one that is none; rest does not jam */
static const double IMPACT_PULL = 1e-9;      /* of the largest impulse: a negative one that is rounding */
enum { FRICTIONAL_SWEEPS = 20000 };
static const double FRICTIONAL_CLOSE = 1e-15; /* of the largest impulse: what a sweep may still change */
static const double FRICTIONAL_ROUGH = 1e-9;  /* beyond which the sweeps have not arrived */

/* ---- friction ---- */
enum { FRICTION_MOST = 6, FRICTION_ROUNDS = 50, FRICTION_ANGLES = 48 }; /* frictions tried together, directions */
static const double FRICTION_SLACK = 1e-12; /* of the cone, and of slip velocities that rounding leaves */
static const double FRICTION_BACK = 1e-9;   /* of the accelerations at work, against its own direction: none */
static const double FRICTION_JUMP = 1e3;    /* times the noise: a slip velocity that no rounding makes */
static const double NONUNIQUE_DEPENDENT = 1e-9; /* of a row's norm, left over by the others: nothing */
static const double NONUNIQUE_WIDE = 1e2;       /* times the forces at work: how far is looked */
enum { NONUNIQUE_ROUNDS = 60 };                 /* bisections, and ellipsoids for each pair of unknowns */
static const double PAINLEVE_SAFE = 1e-9;   /* 1 + A below this counts as not positive */
enum { PAINLEVE_OPENED = 8, PAINLEVE_ROWS = 16 }; /* contacts that are combined, and their rows */

#endif

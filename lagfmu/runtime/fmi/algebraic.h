/* algebraic.h -- multipliers that an importer solves for (FMI-LS-DAE): a differential-algebraic equation of index 1,
 *
 *   M vdot = F + G^T lambda ,   0 = G vdot - gamma     of each row that acts,
 *                               0 = lambda + mu N e    of one that slips, s/|s| = e ,
 *                               0 = lambda             of one that does neither
 *
 * in which lambda is what the importer sets in continuous-time mode, once it has switched DAE mode on, by the parameter
 * at AT_DAE in configuration mode; what it drives to zero is called the equation of a row.  In all other modes the
 * instance solves for lambda, and so with a state projected and modes found by itself; an event has happened too where
 * the lambda that the importer came with says so.  Of rows that depend on each other a basis acts, as long as
 * no event chooses another.
 *
 * All of it is reached by one pointer, NULL in an FMU without. */
#ifndef LAGFMU_ALGEBRAIC_H
#define LAGFMU_ALGEBRAIC_H

#include "instance.h"
#include "linkage.h"

typedef struct {
    /* May a multiplier, or AT_DAE, be set to the value now?  FAILED: no, and the cause is in x->solver.why. */
    Status (*settable)(Instance *x, const Variable *v, double value);
    void (*set)(Instance *x, const Variable *v, double value);
    /* x->imposed has been set: to the state of before, or by a reset. */
    void (*apply)(Instance *x);
    /* An event is over: x->multiplier as the instance solves for them; continuous-time mode begins with these. */
    Status (*renew)(Instance *x);
    Status (*give)(Instance *x);
    /* Continuous-time mode ends. */
    void (*take)(Instance *x);
    /* Factors of the rows that stand for all, frictions among them, where all that act were evaluated. */
    Status (*factor)(Instance *x);
    /* The equation of row k, and its change along the direction that was taken last. */
    Status (*equation)(Instance *x, int k, double *value);
    double (*change)(const Instance *x, int k);
} Algebraic;

SHARED const Algebraic MULTIPLIERS_GIVEN;
SHARED const Algebraic *const ALGEBRAIC; /* of variables.c: &MULTIPLIERS_GIVEN, or NULL */

#endif

/* algebraic.h -- multipliers that an importer solves for (FMI-LS-DAE): a differential-algebraic equation of index 1,
 *
 *   M vdot = F + G^T lambda ,  0 = G vdot - gamma          (hidden in it: 0 = f ,  0 = G v - nu)
 *
 * in which lambda is what the importer sets and G vdot - gamma what it drives to zero.
 *
 * Until it sets the first of them in continuous-time mode the instance solves for all, as in any FMU; from then on
 * all are as they were set or, those that were not, as they came out then, until the instance is reset.
 *
 * All of it is reached by one pointer, NULL in an FMU without. */
#ifndef LAGFMU_ALGEBRAIC_H
#define LAGFMU_ALGEBRAIC_H

#include "instance.h"
#include "linkage.h"

typedef struct {
    /* May a multiplier be set to the value now?  FAILED: no, and the cause is in x->solver.why. */
    Status (*settable)(Instance *x, const Variable *v, double value);
    void (*set)(Instance *x, const Variable *v, double value);
    /* x->imposed has been set: to the state of before, or by a reset. */
    void (*apply)(Instance *x);
    /* der(residual.C), der(residual.C,2): G v - nu, G vdot - gamma. */
    Status (*residual)(Instance *x, const Variable *v, double *value);
} Algebraic;

SHARED const Algebraic MULTIPLIERS_GIVEN;
SHARED const Algebraic *const ALGEBRAIC; /* of variables.c: &MULTIPLIERS_GIVEN, or NULL */

#endif

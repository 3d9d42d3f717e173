/* kinematics.h -- coordinates that move by speeds other than their own rates: q' = B(q, t) v + b(q, t). */
#ifndef LAGFMU_KINEMATICS_H
#define LAGFMU_KINEMATICS_H

#include "arena.h"
#include "linkage.h"
#include "status.h"
#include "system.h"

struct Mechanism;

typedef struct {
    void (*layout)(struct Mechanism *b, Arena *arena);
    /* B and b of q in the mechanism: what the following take. */
    void (*evaluate)(struct Mechanism *b, double t, const double *q, const double *u, const double *p);
    /* rate (nq) = B v + b. */
    void (*rates)(const struct Mechanism *b, const double *v, double *rate);
    /* q <- q + part B w. */
    void (*move)(const struct Mechanism *b, double part, const double *w, double *q);
    /* A displacement along speed i that moves what it moves by x (nq) of theirs; without the angles that are
     * unwrapped unless `turns`. */
    double (*reach)(const struct Mechanism *b, const double *x, int i, int turns);
    /* Unit quaternions of norm 1, and angles within pi of what they equal modulo 2 pi.  FAILED: a quaternion of
     * norm 0, or one of these that is not finite. */
    Status (*settle)(const struct Mechanism *b, double t, double *q, const double *u, const double *p);
    /* Of a change (nq) of q, what is left of it once the quaternions have norm 1 again. */
    void (*settle_change)(const struct Mechanism *b, const double *q, double *dq);
    /* The same along (dt, dq, du, dp), where the angles too come to what they equal. */
    void (*settle_along)(const struct Mechanism *b, double t, const double *q, const double *u, const double *p,
                         double dt, double *dq, const double *du, const double *dp);
    /* change (nq) of B v + b along (dt, dq, dv, du, dp); dB (rates): scratch. */
    void (*change)(const struct Mechanism *b, double t, const double *q, const double *v, const double *u,
                   const double *p, double dt, const double *dq, const double *dv, const double *du,
                   const double *dp, double *dB, double *change);
} Kinematics;

/* NULL in an FMU whose speeds all are rates of coordinates: its optional.c says so, and kinematics.c is not there. */
SHARED const Kinematics *const KINEMATICS;

#endif

/* system.h -- the numeric form of a model, as the solver sees it: functions and index patterns.
 *
 *   M(q,t) vdot = F(q,v,t,u) + G^T lambda ,  G v = nu(q,t,u) ,  G vdot = gamma(q,v,t,u) ,  f(q,t) = 0
 *
 *   q' = v , or  q' = B(q,t) v + b(q,t)  with nv <= nq
 *
 * nq coordinates q, nv speeds v, m constraint rows.  M and G are passed as the lists of their structurally non-zero
 * values: M's lower triangle (row >= column), G row by row, both sorted by (row, column).  That
 * layout is decided by the code printer (codegen/c/) and described by the patterns below.  SI units.
 * model.c, which is generated, defines one `const System`; a table without entries is NULL there. */
#ifndef LAGFMU_SYSTEM_H
#define LAGFMU_SYSTEM_H

#include <stddef.h>

#include "interval.h"
#include "linkage.h"
#include "plan.h"

typedef enum { HOLONOMIC, NONHOLONOMIC, CONTACT } Kind;
typedef enum { MULTIPLIERS, NULLSPACE, MINIMAL } Formulation;

typedef struct {
    const char *name;
    Kind kind;
    int while_closed; /* row of the contact that must be closed for this one to act; -1: always acts */
    int friction;     /* the number, from 1, of the friction by which alone it holds; 0: it holds */
} Row;

/* load + sum_k c_k lambda_k over the rows normal_row[first .. first + normals - 1]: a component of a norm.
 * begins: 1 where it is the first of one. */
typedef struct {
    int first, normals, begins;
} NormalPart;

/* Coulomb friction: |lambda| of one or two rows is at most a part of the normal force, the sum of the norms of the
 * components normal_part[part .. part + parts - 1], over the rows normal_row[first .. first + normals - 1].
 * gated: these are contacts alone, and there is no load, so that while they are open there is no normal force. */
typedef struct {
    const char *name;
    int rows, row[2];
    int part, parts;
    int first, normals, gated;
} Friction;

/* What a joint leaves free, where a start may be given: its value and its rate are outputs of the model's own, or
 * `coordinate` is it, with its rate; otherwise that is -1.  within_turn: known modulo 2 pi alone.  The rate holds the
 * speeds of joint_rate[begin .. end - 1]. */
typedef struct {
    const char *name;
    int coordinate, value, rate;
    int within_turn, begin, end;
} JointCoordinate;

/* A speed in the rate of a joint coordinate.  No joint coordinate holds two speeds of one group. */
typedef struct {
    int speed, group;
} JointRate;

typedef struct System System;

struct System {
    int nq, nv, m;            /* coordinates, speeds, constraint rows */
    int contacts;             /* how many rows are contacts */
    int inputs, parameters;   /* lengths of u, without the switch states behind it, and of p */
    int switches;             /* where forces jump: how many switch states stand behind the inputs in u */
    const int *at_integers;   /* (switches) 1: it switches wherever h is a whole number; 0: where h = 0 */
    int masses, entries;      /* structural non-zeros of M's lower triangle and of G */
    const char *const *coordinates; /* (nq) names */
    const char *const *speeds;      /* (nv) names; of the coordinate where a speed is its rate */
    const int *own_speed;           /* (nv) 1: it is no coordinate's rate; NULL: each is one */
    const Row *rows;          /* (m) */
    const int *contact;       /* (contacts) rows that are contacts, ascending */
    const int *mass_row, *mass_column;   /* (masses) */
    const int *entry_row, *entry_column; /* (entries) */
    const int *row_start;     /* (m + 1) where each row of G begins among its entries */
    int prescribed_count;
    const int *prescribed;    /* positions in u where a prescribed motion begins: u, der(u), der(u,2) */
    int estimated_count;
    const int *estimated;     /* positions of those that der(u,3) follows: their rates are estimated */
    const int *dimension;        /* (nq) coordinates of one physical dimension have one number */
    const double *folded;        /* (nq) the largest magnitude of the dimension among parameters in the coordinate's
                                  * rows that are numbers in the code; NULL: there are none */
    const int *extent_start, *extent; /* (nq + 1), and from there on the parameters of its dimension in its rows */
    const int *speed_dimension;  /* (nv) the number of the dimension of each speed times a second */
    int angles;                  /* the number of those without dimension; -1: none */
    Formulation formulation;
    int separable;            /* constant mass, forces without velocities, position constraints only */
    const struct Square *square; /* square.h: where constraints and prescribed motions leave no freedom; else NULL */
    const Plan *plan;         /* sparse elimination, found when the FMU was built */
    /* x (nv) and lambda (m) of  M x = b + G^T lambda,  G x = c  with all rows acting, the plan written
     * out for a small system; 0 where that is not safe: then linear.h decides.  NULL: not there. */
    int (*solve)(const double *M, const double *b, const double *G, const double *c, double *x,
                 double *lambda);
    /* Both in one, dynamics and solve, for a system without inputs: vdot (nv) at a state. */
    int (*accelerate)(double t, const double *q, const double *v, const double *u, const double *p,
                      double *vdot);

    void (*dynamics)(double t, const double *q, const double *v, const double *u, const double *p,
                     double *M, double *F, double *G, double *nu, double *gamma);
    /* How q moves by v: B (rates), listed by row, then column, and b (nq); and their change along a direction,
     * NULL where nobody asks for derivatives.  0 and NULL where q' = v; then nq = nv. */
    int rates;
    const int *rate_row, *rate_column;
    void (*kinematics)(double t, const double *q, const double *u, const double *p, double *B, double *b);
    void (*kinematics_tangent)(double t, const double *q, const double *u, const double *p, double dt,
                               const double *dq, const double *du, const double *dp, double *dB, double *db);
    /* Unit quaternions: four places in q each, of e0 to e3.  Angles that equal `angle` (unwrapped_count) modulo
     * 2 pi: their places in q, and its change along a direction.  0 and NULL without. */
    int quaternions, unwrapped_count;
    const int *quaternion, *unwrapped;
    void (*unwrapped_angles)(double t, const double *q, const double *u, const double *p, double *angle);
    void (*unwrapped_tangent)(double t, const double *q, const double *u, const double *p, double dt, const double *dq,
                              const double *du, const double *dp, double *dangle);
    /* f (m), 0 for a nonholonomic row */
    void (*residual)(double t, const double *q, const double *u, const double *p, double *f);
    /* (m) the largest magnitude among the terms of each f, of which f is rounding; NULL where there is no f */
    void (*terms)(double t, const double *q, const double *u, const double *p, double *term);
    /* h (switches): the surfaces at which forces jump; NULL where there are none */
    void (*surfaces)(double t, const double *q, const double *u, const double *p, double *h);
    /* bounds on the rates of f of the contacts, then of h of the switches, in boxes of t, q, v and u (with
     * the switch states behind the inputs); NULL where there are none of both */
    void (*bounds)(Interval t, const Interval *q, const Interval *v, const Interval *u,
                   const double *p, Interval *rate);
    /* kinetic and potential energy [J]; NULL where they are not read */
    void (*energies)(double t, const double *q, const double *v, const double *u, const double *p,
                     double *energy);
    /* coefficient of restitution of each row (m); NULL without contacts */
    void (*restitution)(const double *p, double *e);
    /* Start values that the model gives as expressions of parameters: w (started_count), at these positions
     * of (q, v).  0 and NULL without. */
    int started_count;
    const int *started;
    void (*starts)(const double *p, double *w);
    /* What is positive where the joint of a row is not turned over by half a turn, at which products of axes vanish, too:
     * side (side_count), of the rows `sided`.  0 and NULL without. */
    int side_count;
    const int *sided;
    void (*sides)(double t, const double *q, const double *u, const double *p, double *side);
    int joint_count;               /* 0 and NULL without */
    const JointCoordinate *joint;  /* (joint_count) */
    int joint_rates, joint_groups;
    const JointRate *joint_rate;   /* (joint_rates) */
    /* The derivative of all of these along the direction (dt, dq, dv, du, dp): what changes in the values
     * when the state moves that way.  dM (masses), dF (nv), dG (entries), dnu, dgamma, df (m),
     * denergy (2).  NULL where nobody asks for derivatives; dp is read where a run's are asked for. */
    void (*tangent)(double t, const double *q, const double *v, const double *u, const double *p,
                    double dt, const double *dq, const double *dv, const double *du, const double *dp,
                    double *dM, double *dF, double *dG, double *dnu, double *dgamma, double *df,
                    double *denergy);

    /* The model's own outputs w (output_count), from a state and what is solved for there; `other` is
     * the value of a guarded one where w is not finite.  NULL without any, outputs_tangent also where
     * nobody asks for derivatives. */
    int output_count;
    const char *const *output_names; /* (output_count) */
    const int *guarded;              /* (output_count) */
    int unique_count;                /* of which it is said whether multipliers leave them one value, ... */
    const int *unique_output;        /* (unique_count) ... and which these are */
    void (*outputs)(double t, const double *q, const double *v, const double *u, const double *p,
                    const double *vdot, const double *lambda, const double *Q, double *w,
                    double *other);
    void (*outputs_tangent)(double t, const double *q, const double *v, const double *u,
                            const double *p, const double *vdot, const double *lambda,
                            const double *Q, double dt, const double *dq, const double *dv,
                            const double *du, const double *dp, const double *dvdot,
                            const double *dlambda, const double *dQ, double *dw, double *dother);

    /* Where tables are looked up (lookup_count), and where these begin and end.  NULL without any. */
    int lookup_count;
    const char *const *lookup_names;
    const double *lookup_first, *lookup_last;
    void (*lookups)(double t, const double *q, const double *v, const double *u, const double *p,
                    double *places);

    /* An embedding q = phi(s, t), v = J sdot + dphi/dt, from the coordinates that this system steps
     * to those of `full`, from which lambda is recovered; both NULL without one.  If nothing that is
     * solved for is read, `full` has no dynamics, and is nothing but the coordinates that are read. */
    void (*embed)(double t, const double *s, const double *sdot, const double *u, const double *p,
                  double *q, double *v);
    void (*embed_tangent)(double t, const double *s, const double *sdot, const double *u,
                          const double *p, double dt, const double *ds, const double *dsdot,
                          const double *du, const double *dp, double *dq, double *dv);
    const System *full;

    /* Frictions; 0 and NULL without. */
    int frictions, normal_parts, normal_rows;
    const Friction *friction;      /* (frictions) */
    const NormalPart *normal_part; /* (normal_parts) components of the normal forces */
    const int *normal_row;         /* (normal_rows) rows whose multipliers make them up */
    /* static and kinetic coefficient (2 frictions), load (normal_parts) and c (normal_rows) of the normal forces */
    void (*coulomb)(double t, const double *q, const double *v, const double *u, const double *p,
                    double *coefficients, double *load, double *normal);
    void (*coulomb_tangent)(double t, const double *q, const double *v, const double *u, const double *p, double dt,
                            const double *dq, const double *dv, const double *du, const double *dp,
                            double *dcoefficients, double *dload, double *dnormal);
};

/* The state that is stepped: y = (q, v), v = y + nq. */
static inline int system_states(const System *s) { return s->nq + s->nv; }

/* What is read: a system that integrates coordinates of its own reads the full one, with all coordinates and multipliers. */
static inline const System *system_read(const System *s) { return s->embed != NULL ? s->full : s; }

/* What start values are of: y, then the value and the rate of each joint coordinate. */
static inline int system_starts(const System *s) { return system_states(s) + 2 * s->joint_count; }

/* The name of one of these, in three parts: x, der(x), or that of a speed of its own. */
typedef struct {
    const char *head, *name, *tail;
} StateName;

SHARED StateName system_state_name(const System *s, int j);

/* That of vdot[i]: der(x,2), or der() of a speed of its own. */
SHARED StateName system_acceleration_name(const System *s, int i);

/* 1 where a row acts while the contacts stand as in `closed` (one entry a contact); 0 for rows that hold by
 * friction alone, which sliding.c adds where they stick. */
SHARED void system_active(const System *s, const int *closed, int *active);

#endif

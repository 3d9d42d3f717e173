/* state.h -- everything that a simulation remembers between two communication points, and nothing
 * else.  A saved state is a copy of two blocks: this struct's numbers and the arrays behind it. */
#ifndef LAGFMU_STATE_H
#define LAGFMU_STATE_H

#include "arena.h"
#include "integrator.h"
#include "linkage.h"
#include "mechanism.h"
#include "stiffness.h"
#include "system.h"

/* The numbers that an importer sees; they never change (lagfmu/methods.py).  METHOD_NAMES[0] is NULL. */
typedef enum { AUTO = 1, DOP853 = 2, RK4 = 3, RADAU5 = 4, RATTLE = 5 } MethodName;
enum { METHOD_COUNT = 6 };
SHARED const char *const METHOD_NAMES[METHOD_COUNT];

/* How to step.  tolerance: relative, a step; step [s]: largest step of rk4 and rattle, 0: chosen;
 * maximum_step [s]: largest adaptive step, 0: no limit.  maximum_steps: how many steps shorter than 1e-6
 * of the natural time a communication step may take, 0: no limit. */
typedef struct {
    MethodName method;
    double tolerance, step, maximum_step, maximum_steps;
} Settings;

/* Inputs as polynomials in the time since they were set: u_k(elapsed) = value + elapsed * first +
 * elapsed^2 / 2 * second.  A prescribed motion (u, der(u), der(u,2)) goes on by its derivatives: first and second
 * are 0 but of der(u,2). */
typedef struct {
    double since;                     /* [s] when they were set */
    double *value, *first, *second;   /* (inputs) */
    int turned;                       /* 1: they were set to other values than they had come to, ... */
    int jumped;                       /* ... a motion not only by what its rates account for */
} Drive;

/* u at time t.  */
SHARED void drive_at(const System *s, const Drive *drive, double t, double *u);

/* How often, over a whole run, which may last for ever. */
typedef long long Count;

enum { APART_UNKNOWN = 2 }; /* before the first step */

/* How a singular configuration is approached (passage.h): the time [s] of the latest step's beginning, how far the
 * rows were apart there (sine of an angle; negative: such a configuration has been passed since), whether
 * one is near, and in how many seconds (negative: behind). */
typedef struct {
    double t, apart, until;
    int near;
} Approach;

/* The numbers of a state (copied as a struct) ... */
typedef struct {
    double t;            /* [s] the communication point */
    double rate;         /* [1/s] the motion's natural rate at the start */
    int dependent;       /* 1: at the latest state on the constraints, rows that act depended on each other */
    Approach approach;   /* to a singular configuration */
    double step;         /* [s] the step to try next */
    double span;         /* [s] the communication step that led to t; 0: none */
    Count steps;         /* internal steps taken so far */
    Count tiny;          /* those of the present communication step that make no headway */
    int ahead;           /* 1: the integrator stands at integrator->t >= t, and dense output answers */
    int between;         /* 1: q and v are still to be taken from dense output at t: solver_arrive() */
    double event_time;   /* [s] of the event found in the step ahead; only if event_count > 0 */
    int event_count;     /* indicators that leave their ranges then */
    int pending;         /* 1: at t an event has been reached, and its modes are still those before it: solver_meet() */
    double t_old, t_integrator, h_next, error_old; /* of the integrator, when it is ahead */
    int fresh;
    Choice choice;       /* of the method `auto` */
    double lost;         /* [J] that frictions and impacts have dissipated, ... */
    double lost_old, lost_ahead; /* ... and so far where the integrator began its step, and stands */
    double estimated;    /* the largest estimated relative error of a step so far, by the tolerance */
} Numbers;

/* What happens again and again: to a contact, which opens and is closed or struck, and to a friction, which
 * begins to slip and to stick.  Of each kind: how often, and the time and the state of the latest. */
typedef enum { DEPARTURE, CLOSING, SLIPPING, STICKING, EVENT_KINDS } EventKind;
typedef struct {
    Count *count;
    double *time;   /* [s] */
    double *q, *v;  /* (nq), (nv) of each */
} Latest;

/* ... and its arrays, which lie in one block. */
typedef struct {
    Numbers now;
    int looking;              /* 1: events are not counted: solver_look(), after which a saved state is put back */
    double *q, *v;            /* (nq), (nv) at t, on the constraints */
    double *switch_state;     /* (switches) on which side of its surface each force that jumps is evaluated */
    double *offset;           /* (m) f = offset of a row which came back with its contact */
    double *scale;            /* (states) magnitudes below which errors in q and v are measured absolutely */
    double *size;             /* (nq) the coordinates' magnitudes, for rounding */
    double *span;             /* (nv) those of what each speed moves */
    double *gap;              /* (contacts) |f| below which a contact touches */
    int *basis;               /* (m) rows that act, as many of them as were independent there */
    int *closed, *armed;      /* (contacts) */
    int *left;                /* (indicators) its range at the event ahead: 1 upwards, -1 downwards */
    Latest latest[EVENT_KINDS]; /* of each contact, or friction */
    double *impulse;          /* (contacts) [of lambda times s] of the latest closing; 0: none */
    StickSlip *stick_slip;    /* (frictions) how they stand */
    double *variation;        /* (columns * column_size()) derivatives of all that is differentiable here */
    int *varied;              /* one, where there are columns: 1 while they exist */
    double *indicator;        /* (indicators) their values at the integrator's time, when it is ahead */
    char *block;              /* all of the arrays above */
    size_t block_size;
} State;

/* How many there are to which events of a kind happen: contacts, or frictions. */
static inline int event_count_of(const System *s, EventKind kind) {
    return kind <= CLOSING ? s->contacts : s->frictions;
}

/* y (states) of q and v, and back. */
SHARED void state_gather(const System *s, const double *q, const double *v, double *y);
SHARED void state_scatter(const System *s, const double *y, double *q, double *v);

/* An event of contact, or friction, i, now and at the state q, v, unless this is a look. */
SHARED void state_note(State *x, const System *s, EventKind kind, int i, const double *q,
                       const double *v);

#endif

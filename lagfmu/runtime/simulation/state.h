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

/* Methods have the numbers that an importer sees (lagfmu/methods.py).  That of `auto`, which turns from one to another, and
 * one more than any. */
enum { AUTO = 1, METHODS_MOST = 16 };

/* How to step.  tolerance: relative, a step; step [s]: largest step of rk4 and rattle, 0: chosen;
 * maximum_step [s]: largest adaptive step, 0: no limit.  maximum_steps: how many steps shorter than 1e-6
 * of the natural time a communication step may take, 0: no limit. */
#define SETTINGS_NUMBERS(N)                           \
    N(double, tolerance, SIZE, "solver.tolerance")    \
    N(double, step, SIZE, "solver.step")              \
    N(double, maximum_step, SIZE, "solver.maximum_step") \
    N(double, maximum_steps, SIZE, "solver.maximum_steps")
typedef struct {
    int method;
    SETTINGS_NUMBERS(SAVED_MEMBER)
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

/* How a singular configuration is approached (passage.h). */
#define APPROACH "approach to a singular configuration"
#define APPROACH_NUMBERS(N)                                                                                          \
    N(double, t, FINITE, APPROACH)     /* [s] the latest step's beginning */                                         \
    N(double, apart, FINITE, APPROACH) /* sine of the angle between the rows there; negative: such a configuration has \
                                        * been passed since */                                                       \
    N(double, until, FINITE, APPROACH) /* [s] in how many seconds one comes; negative: behind */                     \
    N(int, near, FLAG, APPROACH)       /* 1: one is near */
typedef struct {
    APPROACH_NUMBERS(SAVED_MEMBER)
} Approach;

/* The numbers (copied as a struct), as in saved.h. */
#define STATE_NUMBERS(N)                                                                                             \
    N(double, t, FINITE, "time")                              /* [s] the communication point */                      \
    N(double, rate, LIMIT, "natural rate")                    /* [1/s] of the motion at the start */                 \
    N(int, dependent, FLAG, "rank of the constraints")        /* 1: at the latest state on the constraints rows that act
                                                               * depended on each other */                           \
    N(double, step, LIMIT, "step")                            /* [s] the step to try next */                         \
    N(double, span, SIZE, "communication step")               /* [s] the one that led to t; 0: none */               \
    N(Count, steps, TALLY, "step count")                      /* internal steps taken so far */                      \
    N(Count, tiny, TALLY, "step count")                       /* of the present one, those that make no headway */   \
    N(int, ahead, FLAG, "mode of the step ahead")             /* 1: the integrator stands at t_integrator >= t, and dense
                                                               * output answers */                                   \
    N(int, led, FLAG, "freedom")                              /* 1: there is none: nothing is integrated (inverse.c) */ \
    N(int, between, FLAG, "mode of the step ahead")           /* 1: q and v are still to be found: solver_arrive() */ \
    N(double, event_time, FINITE, "time of the event")        /* [s] found in the step ahead; only if event_count > 0 */ \
    N(int, event_count, COUNT, "count of events")             /* indicators that leave their ranges then */          \
    N(int, pending, FLAG, "event that is reached")            /* 1: its modes are those before it: solver_meet() */  \
    N(double, t_old, FINITE, "integrator's time")             /* of the integrator, when it is ahead, ... */         \
    N(double, t_integrator, FINITE, "integrator's time")                                                             \
    N(double, h_next, LIMIT, "next step")                                                                            \
    N(double, error_old, LIMIT, "error of the step")                                                                 \
    N(int, fresh, FLAG, "mode of the step ahead")             /* ... as far as here */                               \
    N(int, rough, FLAG, "mode of the step ahead")             /* ... within it states are integrated, not interpolated */ \
    N(double, lost, FINITE, "energy dissipated")              /* [J] by frictions and impacts, ... */                \
    N(double, lost_old, FINITE, "energy dissipated")          /* ... so far where the integrator began its step, ... */ \
    N(double, lost_ahead, FINITE, "energy dissipated")        /* ... and stands */                                   \
    N(double, estimated, SIZE, "estimated error")             /* the largest of a step so far, relative */

typedef struct {
    STATE_NUMBERS(SAVED_MEMBER)
    Approach approach;   /* to a singular configuration */
    Choice choice;       /* of the method `auto` */
} Numbers;

/* What happens again and again: to a contact, which opens and is closed or struck, and to a friction, which
 * begins to slip and to stick.  Of each kind: how often, and the time and the state of the latest. */
typedef enum { DEPARTURE, CLOSING, SLIPPING, STICKING, EVENT_KINDS } EventKind;
typedef struct {
    Count *count;
    double *time;   /* [s] */
    double *q, *v;  /* (nq), (nv) of each */
} Latest;

/* How many there are to which events of a kind happen: contacts, or frictions. */
static inline int event_count_of(const System *s, EventKind kind) {
    return kind <= CLOSING ? s->contacts : s->frictions;
}

/* The event indicators (indicators.h): the number of the first of a friction, and how many are watched. */
static inline int indicators_first_of_frictions(const System *s) { return s->contacts + s->switches; }
static inline int indicators_count(const System *s) { return s->contacts + s->switches + 2 * s->frictions; }

/* A column of a run's derivatives holds those of what is remembered: y; of each event time, q, v; impulses;
 * offsets; the energy dissipated. */
static inline int column_of_event(const System *s, EventKind kind, int i) {
    int at = system_states(s);
    for (int k = 0; k < (int)kind; k++) at += event_count_of(s, (EventKind)k) * (1 + system_states(s));
    return at + i * (1 + system_states(s));
}
static inline int column_of_impulse(const System *s, int c) { return column_of_event(s, EVENT_KINDS, 0) + c; }
static inline int column_of_offset(const System *s, int k) { return column_of_impulse(s, s->contacts) + k; }
static inline int column_of_loss(const System *s) { return column_of_offset(s, s->m); }
static inline int column_size(const System *s) { return column_of_loss(s) + 1; }

/* The arrays, which lie in one block; how many: of System *s, Solver *solver. */
#define STATE_ARRAYS(A)                                                                                              \
    A(double, q, s->nq, FINITE, "coordinates")                /* at t, on the constraints */                         \
    A(double, v, s->nv, FINITE, "velocities")                                                                        \
    A(double, switch_state, s->switches, FINITE, "switch states") /* on which side of its surface each force that jumps
                                                               * is evaluated */                                     \
    A(double, offset, s->m, FINITE, "offsets")                /* f = offset of a row which came back with its contact */ \
    A(double, scale, s->nq + s->nv, SIZE, "scales")           /* below which errors in q and v are measured absolutely */ \
    A(double, size, s->nq, SIZE, "sizes")                     /* the coordinates' magnitudes, for rounding */        \
    A(double, span, s->kinematics != NULL ? s->nv : 0, SIZE, "sizes") /* those of what each speed moves; no array: size */ \
    A(double, felt, s->nv, SIZE, "accelerations")             /* that forces gave at the start, before they cancel */ \
    A(double, height, s->contacts, SIZE, "gaps")              /* the farthest that an open contact has been, ... */  \
    A(double, extent, s->contacts, SIZE, "gaps")              /* ... and the largest term of its f there */          \
    A(double, gap, s->contacts, SIZE, "gaps")                 /* |f| below which a contact touches */                \
    A(int, basis, s->m, FLAG, "rank of the constraints")      /* rows that act, as many as were independent there */ \
    A(int, closed, s->contacts, FLAG, "modes")                                                                       \
    A(int, armed, s->contacts, FLAG, "modes")                                                                        \
    A(int, left, indicators_count(s), OTHER, "events")        /* its range at the event ahead: 1 upwards, -1 downwards */

#define STATE_ARRAYS_BEHIND(A)                                                                                       \
    A(double, impulse, s->contacts, SIZE, "impulses")         /* [of lambda times s] of the latest closing; 0: none */ \
    A(StickSlip, stick_slip, s->frictions, OTHER, "modes")    /* how they stand: friction_modes() */                 \
    A(double, indicator, indicators_count(s), FINITE, "indicators") /* at the integrator's time, when it is ahead */ \
    A(double, variation, solver->columns * column_size(s), FINITE, "derivatives of the run")                         \
    A(int, varied, solver->columns > 0, FLAG, "derivatives of the run") /* one, where there are columns: they exist */

typedef struct {
    Numbers now;
    int looking;              /* 1: events are not counted: solver_look(), after which a saved state is put back */
    STATE_ARRAYS(SAVED_POINTER)
    Latest latest[EVENT_KINDS]; /* of each contact, or friction */
    STATE_ARRAYS_BEHIND(SAVED_POINTER)
    char *block;              /* all of the arrays above */
    size_t block_size;
} State;

/* y (states) of q and v, and back. */
SHARED void state_gather(const System *s, const double *q, const double *v, double *y);
SHARED void state_scatter(const System *s, const double *y, double *q, double *v);

/* An event of contact, or friction, i, now and at the state q, v, unless this is a look. */
SHARED void state_note(State *x, const System *s, EventKind kind, int i, const double *q,
                       const double *v);

#endif

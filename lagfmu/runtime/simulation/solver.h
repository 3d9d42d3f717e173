/* solver.h -- the simulation of one instance: start, advance, observe.  Knows no FMI. */
#ifndef LAGFMU_SOLVER_H
#define LAGFMU_SOLVER_H

#include "linkage.h"
#include "mechanism.h"
#include "observed.h"
#include "start_priority.h"
#include "sensitivity.h"
#include "state.h"

/* Where solver_advance() ends before its t_end: nowhere, but an event is passed within; after each event; before its
 * modes change, at each event or at one that lies at t_end. */
typedef enum { HALT_NEVER, HALT_AFTER, HALT_BEFORE, HALT_BEFORE_LAST } Halt;

/* By what a column of a run's derivatives is taken: p[parameter], or the start value of `state`; the other is -1. */
typedef struct {
    const char *name;
    int parameter, state;
} Column;

/* What the caller does within a step; NULL: nothing.  The inputs at a time, those that are not by their polynomials:
 * u (inputs).  Between two steps, at the state of now: t_end may come nearer, and nothing else changes. */
typedef struct {
    void *own;
    void (*supply)(void *own, double t, double *u);
    void (*pause)(void *own, double *t_end);
} Caller;

/* linear_apart() at the latest stage, and the least of a step. */
typedef struct {
    double apart, narrowest;
} Stages;

/* The memory of the parts of a simulation, each laid out and known by its own files alone; NULL where the FMU holds no such
 * part.  Nothing in it is kept from one call of the solver to the next. */
typedef struct {
    struct StartMemory *start;       /* initial_projection.h */
    struct JointSearch *joints;      /* joint_coordinates.h */
    struct NominalsMemory *nominals; /* nominals.c */
    struct AdvanceMemory *advance;   /* advance.c */
    struct SearchMemory *search;     /* event_search.h */
    struct LossesMemory *losses;     /* losses.c */
    struct ContactMemory *contacts;  /* contacts.h */
    struct FrictionMemory *frictions; /* stick_slip.h */
    struct SwitchMemory *switches;   /* switches.c */
    struct PassageMemory *passage;   /* passage.c */
    struct CrossingMemory *crossing; /* crossing.c */
    struct Saltation *columns;       /* saltation.h */
} Parts;

typedef struct Solver {
    const System *system;
    Settings settings;
    double stop_time;          /* [s]; infinite if it is not defined: never stepped past */
    int on_demand;             /* 1: q and v between two steps are found when the caller asks: solver_arrive() */
    Halt halt;
    Caller caller;
    double limit;              /* [s] of a step, of the finer run of error bars (error_bars.h); 0: none */
    double first, taken;       /* [s] the first and the longest step that led to the communication point */
    State state;
    Drive drive;
    double *p;                 /* (parameters) */
    Mechanism stepped, full;   /* full: of an embedding; otherwise unused */
    Integrator integrator, probe; /* probe: integrates again from the last accepted point */
    int *active, *active_full; /* (m) rows that act in the present modes; (m of full) there */
    double *scale;             /* (states) of errors, in the present step */
    double *u;                 /* (inputs, then switches) at the time of the latest evaluation */
    Sensitivity sensitivity;   /* of `stepped` */
    const struct Feature *const *features; /* feature.h; NULL: a run with nothing but the motion.  Set before the layout */
    void *own[8];              /* what each keeps (FEATURES_MOST) */
    int columns;               /* how many columns of derivatives go with the state (variation.h), and ... */
    const Column *column;      /* (columns) ... by what; both are set before the layout */
    Stages stages;
    unsigned long shown;       /* stepped.evaluations when all rows' motion at the communication point was; 0: it was not */
    Parts part;
    Why passed;                /* singular configurations passed since the caller emptied it, as a sentence */
    Why why;
} Solver;

/* What is integrated: the state, and the columns of its derivatives. */
static inline int solver_width(const Solver *s) { return system_states(s->system) * (1 + s->columns); }

/* (m) The rows for states off the constraints: those that act, as many of them as are independent. */
static inline const int *solver_rows(const Solver *s) {
    return s->state.now.dependent ? s->state.basis : s->active;
}

/* layout.c -- takes all memory of the solver: what must be saved from `saved`, the rest from `scratch`.  Of
 * `saved` the first state.block_size bytes are the state's arrays; the drive and p follow.  To be
 * called once with arenas that count (base = NULL) and once with memory. */
SHARED void solver_layout(Solver *s, Arena *saved, Arena *scratch, const System *system);

/* One start value, of state j, that had to be moved onto the constraints. */
typedef void (*Moved)(void *context, int j, double given, double used, Priority priority);

/* initialization.c -- the consistent state at t nearest to the start values q0 (nq), v0 (nv, not in s->state) of
 * priority (states, of the coordinates and then of the speeds: which of them move first), for the drive and
 * p that the caller has set; `moved` (may be NULL) is called for each value that
 * was moved.  FAILED: the start is refused, the cause is in s->why; the state is in disorder. */
SHARED Status solver_start(Solver *s, double t, const double *q0, const double *v0, const Priority *priority,
                           Moved moved, void *context);

/* No state yet: at t [s], with nothing in it.  For a start that was refused. */
SHARED void solver_clear(Solver *s, double t);

SHARED void advance_layout(Solver *s, Arena *scratch);

/* advance.c -- from state.now.t to t_end [s], or as far as `halt` says.  FAILED leaves the state in disorder: the
 * caller puts the saved one back (it keeps a copy). */
SHARED Status solver_advance(Solver *s, double t_end);

/* The event that is pending, if there is one: the modes after it, the limit from the right.  FAILED as above. */
SHARED Status solver_meet(Solver *s);

/* input_jump.c -- the inputs may have been set: switch states are those of now, contacts whose surface went away
 * open, the others go with it; a prescribed motion may have another place and other rates than it went by, and
 * forces others than the modes of contacts and frictions belong to (drive.turned).  What each step begins
 * with.  FAILED leaves the state in disorder. */
SHARED Status solver_follow(Solver *s);

/* The same, with nothing counted, for a caller that then puts the saved state back. */
SHARED Status solver_look(Solver *s);

/* The inputs were set: what was integrated ahead with the old ones is dropped. */
SHARED void solver_inputs_changed(Solver *s);

/* q and v at the communication point, where they are still to be found (on_demand).  FAILED: they cannot
 * be projected onto the constraints. */
SHARED Status solver_arrive(Solver *s);

/* The same where the integrator has been beyond t_end already, and q and v there are found on demand: nothing
 * is left to do, and nothing can fail.  0: it has not been there, and nothing was done. */
SHARED int solver_pass(Solver *s, double t_end);

/* observe.c -- evaluates all of them at the state and inputs of now.  FAILED: one is not finite. */
SHARED Status solver_observe(Solver *s, Observed *o);

#endif

/* instance.h -- one simulation behind an FMU: values by variable, start, step, saved states.
 *
 * Knows the table of variables and the solver, and nothing of the interface by which an importer
 * calls.  All memory is one block that the caller gives. */
#ifndef LAGFMU_INSTANCE_H
#define LAGFMU_INSTANCE_H

#include "error_bars.h"
#include "linkage.h"
#include "rates.h"
#include "sensitivity.h"
#include "solver.h"
#include "variables.h"

/* What there is to tell: while a call succeeds; of a step that could not be done, of what is refused. */
typedef enum { NOTE_WARNING, NOTE_EVENT, NOTE_DISCARD, NOTE_ERROR } Note;
typedef void (*Tell)(void *context, Note note, const char *text);

/* What an importer exchanges with an instance within a step; nothing where `look` is NULL. */
typedef struct {
    double (*look)(void *context, double t, double end); /* at time t [s], between two steps; where this one is to end */
    void (*ask)(void *context, double t);                /* for the inputs at time t [s], into `value` */
    int supplies;            /* 1: there are such inputs */
    int *supplied;           /* (inputs) 1: it gives this one within steps */
    double *value;           /* (inputs) the latest */
    double asked, finished, end; /* [s] the latest time of each, of this step */
    int paused;              /* 1: it looks */
} Between;

/* Numbers of an instance that a saved state holds, as in saved.h. */
#define INSTANCE_NUMBERS(N)                                                                                           \
    N(double, start_time, FINITE, "start time")               /* [s] of the experiment; its end is solver.stop_time */ \
    N(double, tolerance, SIZE, "tolerance")                   /* of the experiment; 0: none */                        \
    N(double, gain, FINITE, "stabilization")                  /* [1/s] of model exchange; < 0: not known yet */       \
    N(int, exchange, FLAG, "type")                            /* 1: an importer's integrator moves the state (exchange.h) */ \
    N(int, phase, OTHER, "mode")                              /* for the caller */                                    \
    N(int, started, FLAG, "mode")                             /* 1: the consistent start has been found */            \
    N(int, running, FLAG, "mode")                             /* 1: the start is over, only inputs can be set */      \
    N(int, warned, OTHER, "mode")                             /* 1: a jump of a prescribed motion has been told; 2 << i:
                                                               * lookup i outside */                                  \
    N(int, held, FLAG, "discrete values")                     /* 1: those of the latest event are in `flag` (exchange.h) */ \
    N(int, weighed, FLAG, "nominals")                         /* 1: that they are not the description's has been told */ \
    N(int, moved, FLAG, "whether an event has moved the states")   /* in model exchange, since this was told */       \
    N(int, ticking, FLAG, "whether clocks tick")              /* 1: an event of this instant has been met, and not yet
                                                               * what follows from it */                              \
    N(int, dae, FLAG, "DAE mode")                             /* 1: an importer solves for multipliers (algebraic.h), ... */ \
    N(int, imposed, FLAG, "multipliers")                      /* ... and they are now as it has set them */

typedef struct Instance {
    Solver solver;
    INSTANCE_NUMBERS(SAVED_MEMBER)
    Settings given;         /* solver.* as they were set; tolerance 0: not set */
    Between between;        /* context: that of tell() */
    /* What was found of the state holds as long as the version of which it was found is the one of now: */
    unsigned long version;  /* raised by each change of the state, of inputs, modes and parameters */
    unsigned long observed, evaluated; /* of `seen`; of the accelerations of exchange.c */
    unsigned long motion, evaluations; /* ... while this was the solver's latest evaluation */
    unsigned long followed; /* the state goes with a motion that was set; as it was in `backup` */
    unsigned long refused;  /* the values that are set have no start, and why */
    Why refusal;
    Observed seen;          /* what can be read at the state */
    Sensitivity along;      /* of the full system, where there is an embedding */
    Instant at;             /* of instance_factor() */
    Bars *bars;             /* error bars; NULL without */
    struct Derived *derived; /* of derivatives.c; NULL without a run's derivatives */
    Past *past;             /* (estimated_count of the system) */
    double *multiplier;     /* (m) those that an importer has set */
    double *places;         /* (lookup_count) scratch */
    double *work;           /* (7 states) of exchange.c, exchange_events.c and exchange_gain.c */
    double *back;           /* (3 nv + m + inputs + switches) of exchange.c: changes of vdot, what leads back onto the constraints */
    double *set_before;     /* (VARIABLE_COUNT) of component_initial.c */
    double *norm;           /* (quaternions) of those that an importer has set, before they were settled */
    int apart;              /* 1: along the direction accelerations change, but no multipliers satisfy all constraints */
    double dlost;           /* of a direction: the change of the energy dissipated, where that is a state */
    int unsettled;          /* 1: states were set one by one */
    double *q0, *v0;        /* (nq), (nv) start values as they were set */
    double *joint0;         /* (2 joint_count) those of joint coordinates and their rates */
    Priority *priority;     /* (system_starts()) who said them; found anew at each start */
    double *begin;          /* (system_starts()) the start values then, with those that follow from parameters */
    double *formula;        /* (started_count of the system) these */
    int *flag;              /* (exchange_flag_count()) */
    double *expected;       /* (inputs) values at the end of the latest step */
    int *set;               /* (inputs) 1: set since the latest step */
    Count *before[EVENT_KINDS]; /* (contacts, or frictions) how many events there were before a step */
    int *shared;            /* (frictions) 1: that its normal force is not unique has been told */
    int *happened;          /* (contacts) */
    double *pull;            /* (contacts) [of f/s^2] acceleration towards each, of exchange.c */
    double *indicators;      /* (event indicators) scratch, for one that is read */
    char *saved, *backup;   /* what must be saved; a copy from before a step */
    size_t saved_size;
    Tell tell;
    void *context;          /* of tell() */
    int quiet;              /* 1: nobody listens to NOTE_EVENT, and no text need be made */
    char note[512];
} Instance;

/* Takes all memory from the arena; with base = NULL it is counted. */
SHARED void instance_layout(Instance *x, Arena *arena);

/* Puts the values of the description into an instance that was laid out. */
SHARED void instance_reset(Instance *x);

/* The value of a variable.  FAILED, the cause in x->solver.why, if it cannot be calculated. */
SHARED Status instance_get(Instance *x, const Variable *v, double *value);

/* The same of what lies in a state that `o` was observed at: of this instance, or of a finer run. */
SHARED Status instance_value(Solver *s, const Observed *o, const Variable *v, double *value);

/* The value of a variable that is not an output, as it was set. */
SHARED double instance_setting(const Instance *x, const Variable *v);

/* Sets a variable that is not an output, and whose value has been checked. */
SHARED void instance_set(Instance *x, const Variable *v, double value);

/* The inputs are others than those under which the runs have stepped ahead. */
SHARED void instance_inputs_changed(Instance *x);

/* Sets the derivative of an input with respect to time; order 1 or 2. */
SHARED void instance_set_input_derivative(Instance *x, const Variable *v, int order, double value);

/* As an importer drives it, whatever the version of FMI (experiment.c).  FAILED: nothing has changed, and the
 * cause is in x->solver.why. */

/* Times in s; a tolerance or a stop time that is not defined is NULL. */
SHARED Status instance_set_up(Instance *x, const double *tolerance, double start, const double *stop);

/* May the variable be set to the value now?  The rules of interface/variables.py, by the same table. */
SHARED Status instance_settable(Instance *x, const Variable *v, double value);

/* Sets a variable to a value that it may be set to: nothing happens where a parameter has these bits. */
SHARED void instance_put(Instance *x, const Variable *v, double value);

/* The end of the initialization: from here on only inputs can be set. */
SHARED Status instance_initialize(Instance *x);

/* Is there a communication step from t to t + h [s] now? */
SHARED Status instance_steppable(Instance *x, double t, double h);

/* The consistent start, unless it is known already, or that there is none. */
SHARED Status instance_start(Instance *x);

/* The place among (q, v, energy dissipated) of a variable that is a continuous state, or -1.  One that an importer's
 * integrator sets alone (FAILED: it is not finite) is settled with the others when next something is read: quaternions
 * are normalized, angles counted.  FAILED: one of them is no rotation. */
SHARED int instance_state(const Variable *v);
SHARED Status instance_state_settable(Instance *x, const Variable *v, double value);
SHARED void instance_set_state(Instance *x, const Variable *v, double value);
SHARED Status instance_settle_states(Instance *x);
SHARED void instance_settled(Instance *x); /* the state was found here: its quaternions have the norm 1 */


/* The start from the values that were set, with that of `state` (-1: none) moved by `part` as if it had been set. */
SHARED Status instance_start_again(Instance *x, int state, double part);

/* What can be read at the state, unless it is known already. */
SHARED Status instance_observe(Instance *x);
SHARED Status instance_observe_unique(Instance *x); /* from now on with which outputs are unique */

/* To t_end [s].  FAILED: everything is as it was before. */
SHARED Status instance_step(Instance *x, double t_end);

/* Events that an importer of co-simulation meets itself (instance_events.c; solver.halt says where steps end).  The
 * limit from the right of the one that is pending, if there is one; what inputs that were set since bring about at once:
 * `again`, 1 if a contact or a friction changes.  FAILED: everything is as it was before. */
SHARED Status instance_meet(Instance *x);
SHARED Status instance_settle(Instance *x, int *again);

/* 1: that clock ticks at this instant; those of contacts come first, then those of frictions. */
SHARED int instance_ticks(const Instance *x, int clock);

/* Events are counted from here on; has there been one; what is told of them. */
SHARED void instance_count_events(Instance *x);
SHARED int instance_event_happened(const Instance *x);
SHARED void instance_tell_events(Instance *x);

/* How everything changes along a direction of time, stepped coordinates (nq), speeds (nv) and inputs;
 * then how one variable changes with it.  FAILED: it cannot be said, the cause is in x->solver.why. */
SHARED Status instance_differentiate(Instance *x, Direction d);

/* The same in two: what all directions at this state need, once, and then along as many as there are. */
SHARED Status instance_factor(Instance *x);
SHARED Status instance_differentiate_factored(Instance *x, Direction d, Differentiate *solve);
SHARED void instance_change_outputs(Instance *x, Direction d); /* of these the model's own alone */

SHARED Status instance_change(const Instance *x, const Variable *v, Direction d, double *change);

/* The same along the motion: the derivative of a variable with respect to time. */
SHARED Status instance_rates(Instance *x, Direction *d);

/* Among the files of an instance.  The state as the importer left it: what is set next may be the rest of the
 * motion that was looked at. */
SHARED void instance_unfollow(Instance *x);

/* The value of a variable that was set; 0 if it is none that can be. */
SHARED int instance_was_set(const Instance *x, const Variable *v, double *value);

/* 1: inputs have other values than they had come to, and more than the forces may change with them. */
SHARED int instance_turned(const Instance *x);

/* Tells the drive whether they have, and whether a motion has jumped. */
SHARED void instance_turn(Instance *x);

/* Once for each: redundant rows share a normal force, and the motion may depend on how. */
SHARED void instance_warn_of_shares(Instance *x);

/* Saved states: `instance_record_size` bytes that hold no pointer. */
SHARED size_t instance_record_size(const Instance *x);
SHARED void instance_save(Instance *x, char *record);
SHARED void instance_restore(Instance *x, const char *record);

/* Is what was read from a saved state a state that this FMU can be in (saved_check.c)?
 * Looks at everything that instance_restore() has just put into the instance.  FAILED: it is no state
 * of this FMU, the cause is in x->solver.why; nothing of it must be used. */
SHARED Status instance_restored(Instance *x);

/* The same of one solver of it alone; and why a state is none. */
SHARED Status restored_solver(Instance *x, const Solver *s);
SHARED Status restored_none(Instance *x, const char *name, double value);

#endif

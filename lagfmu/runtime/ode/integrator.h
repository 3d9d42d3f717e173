/* integrator.h -- y' = f(t, y): one step of any method, and dense output over the step just taken.
 *
 * Each method is a file with its tableau's source, which defines a Method (one
 * that steps a mechanical system, not an ODE, fills the same Integrator).  Error weights: an
 * accepted step has a root-mean-square error below 1 in units of tolerance * max(|y_i|, scale_i);
 * radau's estimate is of lower order: it is kept below 0.1 tolerance^(2/3), so that the error is. */
#ifndef LAGFMU_INTEGRATOR_H
#define LAGFMU_INTEGRATOR_H

#include "arena.h"
#include "linkage.h"
#include "status.h"

typedef struct {
    void *context;
    /* f(t, y); FAILED where it cannot be evaluated: the step is cut there, the cause is in `why` */
    Status (*rate)(void *context, double t, const double *y, double *dydt);
    /* J = df/dy of the components that are watched (n), dense, row by row (n * n), and df/dt (n); for radau.  The
     * others, if there are any, are blocks of n with x' = J x + ... of their own. */
    Status (*jacobian)(void *context, double t, const double *y, double *J, double *dfdt);
    Why *why;
    const void *mechanism; /* of a method that steps one itself: an Acting (mechanism.h) */
} Ode;

typedef struct {
    double tolerance;      /* relative, per step */
    const double *scale;   /* (watched) magnitudes below which errors are measured absolutely */
    double maximum_step;   /* [s]; 0: no limit */
    double fixed_step;     /* [s]; of methods with one */
} Control;

typedef struct Method Method;

/* Everything up to `memory` and the arrays it points to must be saved for a bit-exact rollback;
 * `scratch` holds nothing from one call to the next. */
typedef struct {
    const Method *method;
    int ny, watched;   /* components, and how many of them, the first, control the step */
    double t_old, t;   /* the step just taken went from t_old to t */
    double h_next;     /* the step to try next; 0: to be chosen from the problem */
    double error_old;  /* memory of the step-size controller */
    double error;      /* estimated local error of the step just taken, in units of the tolerance; 0: of fixed steps */
    double *y, *f;     /* (ny) state at t and f(t, y) there; f is valid when `fresh` is 0 */
    double *y_old, *f_old; /* (ny) at t_old */
    double *dense;     /* (method->dense_arrays * ny) what the dense output needs */
    int fresh;         /* 1: f(t, y) is not known yet: y was set or moved, or nobody needed it */
    int fixed_left;    /* fixed-step methods: steps left to the latest bound (to be read only) */
    double *scratch;
    int *pivots;
} Integrator;

struct Method {
    const char *name;
    int dense_arrays;                 /* arrays of ny doubles in `dense` */
    int scratch_arrays;               /* arrays of ny doubles in `scratch`, */
    int scratch_matrices;             /* and of watched^2, with as many pivots each, of RADAU_MOST_STATES at most */
    int last_stage; /* arrays in `dense` before two of a stage at t, its argument and its rate, which
                     * stay as they are; 0: they are not kept */
    int coarse;                       /* dense() has fewer digits than the step: to search by, not to be read */
    int exact;                        /* what it steps to is on the constraints, and has no error of a step */
    int fixed;                        /* a fixed step that divides the way to t_bound evenly, ... */
    double fewest_steps;              /* ... so many in one natural time of the motion unless solver.step is set */
    int of_mechanism;                 /* 1: it steps ode->mechanism, whose rows stay as they are */
    /* One accepted step from integrator->t towards t_bound, never past it.  On success t_old,
     * y_old, f_old, t, y, h_next are new, and dense() answers in [t_old, t]; the dense data may be
     * completed lazily by `prepare_dense`.  FAILED (step size underflow, not finite): as before the
     * call, but that f may be known now. */
    Status (*step)(Integrator *i, const Ode *ode, const Control *control, double t_bound);
    /* Where a step of rows that depend on each other or may begins, whose motion has been evaluated there: `of` is the
     * Ode's context.  NULL: nothing to do. */
    void (*begin)(Integrator *i, void *of);
    /* Evaluates what dense() needs beyond the step itself; called at most once a step.  To be
     * called before y is changed by a projection, after which dense() answers as before.  NULL:
     * nothing to do. */
    Status (*prepare_dense)(Integrator *i, const Ode *ode);
    void (*dense)(const Integrator *i, double t, double *y);
    /* The largest error of dense() within the step, in units of the tolerance; after prepare_dense.  NULL: not known. */
    Status (*dense_error)(Integrator *i, const Ode *ode, const Control *control, double *error);
    /* Estimate of the error of one component in the step just taken, of a method that controls none.  NULL: not known. */
    double (*error)(const Integrator *i, int component);
};

enum { RADAU_MOST_STATES = 800 }; /* for which radau keeps dense matrices */

/* Takes memory for any of `count` methods (NULL: none) from the arena.  The arrays that must be saved (y, f, y_old,
 * f_old, dense) come from `saved`, the scratch from `scratch`. */
SHARED void integrator_layout(Integrator *i, Arena *saved, Arena *scratch, int ny, int watched,
                              const Method *const *methods, int count);

/* Puts the integrator at (t, y); h: step to try first, 0: to be chosen. */
SHARED void integrator_start(Integrator *i, const Method *method, double t, const double *y, double h);

/* Replaces the state at the end of the step just taken (after a projection). */
SHARED void integrator_move(Integrator *i, const double *y);

#endif

/* error_bars.h -- error bars: how far the values of this run may be off, estimated by a finer run beside it.
 *
 * The finer run steps the same equations from the same consistent start under the same inputs, at the
 * tolerance FINER tol, with steps no longer than SHORTER times the delivered one's longest.  With x of the
 * delivered run and y of the finer run, at the communication points t_k so far,
 *
 *   bar = max( MARGIN max_k max( d_k, SPREAD a_k X_k ),  ROUNDING eps sqrt(steps) X ) ,
 *   d = |x - y| ,   a = max( max_j |q_j - q'_j| / scale_j, the same of v,  ESTIMATE max err tol ) :
 *
 * d is the delivered run's error but for the finer run's own, which is smaller.  Early in a run d may be small
 * by chance: then what counts is how far the two states are apart, or what the method itself estimates of
 * its largest step, err tol; X is the largest magnitude of x so far, no smaller than what it is made of (the
 * forces that cancel in it, the scale of the motion).  What is the same in both runs depends on neither
 * (docs/error_bars.md).
 *
 * All of it is reached by one pointer, NULL in an FMU without error bars. */
#ifndef LAGFMU_ERROR_BARS_H
#define LAGFMU_ERROR_BARS_H

#include "linkage.h"
#include "solver.h"
#include "variables.h"

struct Instance;

typedef struct {
    Solver solver;    /* the finer run; its inputs and parameters are the delivered run's own */
    unsigned long observed; /* the version of the instance of which the following was found */
    Observed seen;    /* what can be read at its state, and with it: */
    double *state, *scale; /* (states) q, v of the delivered run, and below which rounding of them is absolute */
    double *push;     /* (nv of the full system) of the magnitudes of all constraints' forces */
    double apart;     /* the largest relative difference of the two states */
    int paired;       /* both runs have met the same events */
    int first, end;   /* the bars' positions among the variables, where they stand together */
    /* saved with the instance: */
    Numbers *kept;    /* the finer run's numbers, from instance_save() on */
    double *worst;    /* (bars) the largest so far, but for rounding */
    double *size;     /* (bars) the largest magnitude so far */
    int *lost;        /* 1: the finer run could not follow, bars are infinite from there */
} Bars;

typedef struct {
    /* Takes memory as instance_layout() does. */
    void (*layout)(struct Instance *x, Arena *saved, Arena *scratch);
    /* The finer run stands where the delivered run starts. */
    void (*start)(struct Instance *x);
    /* The present differences count from here on: before the next step, when the inputs are set and most often
     * all has been read. */
    void (*widen)(struct Instance *x);
    /* Before and after the delivered run goes to t_end [s]. */
    void (*begin_step)(struct Instance *x, double t_end);
    void (*follow)(struct Instance *x, double t_end);
    void (*inputs_changed)(struct Instance *x);
    /* The finer run goes with a prescribed motion that was set, as the delivered run does to be read. */
    void (*turn)(struct Instance *x);
    /* The bar of a variable; the largest double stands for infinity. */
    Status (*get)(struct Instance *x, const Variable *v, double *value);
    void (*save)(const struct Instance *x);
    void (*restore)(struct Instance *x);
    /* FAILED: what was read is no state of a finer run. */
    Status (*restored)(struct Instance *x);
} ErrorBars;

SHARED const ErrorBars BARS;
SHARED const ErrorBars *const ERROR_BARS; /* of variables.c: &BARS, or NULL */

#endif

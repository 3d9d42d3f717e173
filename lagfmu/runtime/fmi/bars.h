/* bars.h -- error bars: how far the values of this run may be off, estimated by a companion run beside it.
 *
 * The companion steps the same equations from the same consistent start under the same inputs, at a
 * tolerance that is BAR_COARSER times the delivered one's.  With x of the delivered run and y of the
 * companion, at the communication points t_k so far,
 *
 *   bar = max( max_k s_k d_k ,  rounding of max_k |x(t_k)| ) ,   d_k = |x(t_k) - y(t_k)| ,
 *   s_k = min(1, BAR_MARGIN / r_k) (1 + BAR_FEW / N_k) :
 *
 * d is the companion's error, which is r times the delivered one's if local errors were all there is: r is the
 * ratio of the sums of h^(p + 1) of both, N the companion's sum in its largest part (companion.h).  Where d is
 * no longer small beside |x| the motions part, and s is at least min(1, s + d / max |x|) (docs/error_bars.md).
 *
 * All of it is reached by one pointer, NULL in an FMU without error bars. */
#ifndef LAGFMU_BARS_H
#define LAGFMU_BARS_H

#include "solver.h"
#include "variables.h"

struct Instance;

typedef struct {
    Solver solver;    /* the companion; its inputs and parameters are the delivered run's own */
    Observed seen;    /* what can be read at its state, while `observed` is 1 */
    int observed;
    int first, end;   /* the bars' positions among the variables, where they stand together */
    /* saved with the instance: */
    Numbers *kept;    /* the companion's numbers, from instance_save() on */
    double *worst;    /* (bars) the largest so far, but for rounding */
    double *size;     /* (bars) the largest magnitude so far */
    int *lost;        /* 1: the companion could not follow, bars are infinite from there */
} Bars;

typedef struct {
    /* Takes memory as instance_layout() does. */
    void (*layout)(struct Instance *x, Arena *saved, Arena *scratch);
    /* The companion stands where the delivered run starts. */
    void (*start)(struct Instance *x);
    /* The present differences count from here on: before the next step, when the inputs are set and most often
     * all has been read. */
    void (*widen)(struct Instance *x);
    /* Before and after the delivered run goes to t_end [s]. */
    void (*begin_step)(struct Instance *x, double t_end);
    void (*follow)(struct Instance *x, double t_end);
    void (*inputs_changed)(struct Instance *x);
    /* The companion goes with a prescribed motion that was set, as the delivered run does to be read. */
    void (*turn)(struct Instance *x);
    /* The bar of a variable; the largest double stands for infinity. */
    Status (*get)(struct Instance *x, const Variable *v, double *value);
    void (*save)(const struct Instance *x);
    void (*restore)(struct Instance *x);
    /* FAILED: what was read is no state of a companion. */
    Status (*restored)(struct Instance *x);
} ErrorBars;

extern const ErrorBars BARS;
extern const ErrorBars *const ERROR_BARS; /* of variables.c: &BARS, or NULL */
extern const double BAR_COARSER, BAR_MARGIN, BAR_FEW, BAR_ROUNDING; /* of variables.c: solver/bars.py */

#endif

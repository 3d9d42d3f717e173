/* outputs.h -- the outputs of the model's own: a tension, a height, a power. */
#ifndef LAGFMU_OUTPUTS_H
#define LAGFMU_OUTPUTS_H

#include "linkage.h"
#include "solver.h"

/* Their values from what was observed at `at` (the rest of `o`).  FAILED: one has none, and nothing in
 * its place. */
SHARED Status outputs_observe(const System *s, Instant at, Observed *o, Why *why);

/* Are those of which it is asked the same with all multipliers of this motion?  `b` as it was factored for it. */
SHARED void outputs_unique(Mechanism *b, Instant at, Observed *o);

/* Beyond, where rows that depend on each other are refused (linear.h), all multipliers are unique. */
static inline int outputs_told_apart(const System *s) { return s->nv + s->m <= DENSE_MOST; }

/* What that needs: values and those where they have none, slopes, multipliers, lengths of rows, x. */
static inline int outputs_unique_doubles(const System *s) {
    const int apart = outputs_told_apart(s) ? s->m * (s->unique_count + 2) + s->nv : 0;
    return s->unique_count == 0 ? 0 : apart + 3 * s->output_count;
}

/* Their changes w->down along a direction (full coordinates), from those that `sensitivity_along` found
 * with `b`; b = NULL where nothing was solved for.  A change that hangs on a multiplier which is not
 * unique is no number. */
SHARED void outputs_change(Sensitivity *w, const Mechanism *b, const System *s, Instant at,
                           const Observed *o, Direction d);

#endif

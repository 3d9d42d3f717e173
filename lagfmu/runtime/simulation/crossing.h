/* crossing.h -- configurations in which constraints depend on each other for an instant: two branches of the motion cross
 * there. */
#ifndef LAGFMU_CROSSING_H
#define LAGFMU_CROSSING_H

#include "linkage.h"
#include "solver.h"

/* How far off the constraints a state is taken to be that the rows are named at: linear_rank_threshold(). */
#define CROSSING_NAMING 1e-5

/* Factors the rows that stages are evaluated by, at (t, y), taken to be off the constraints by that much. */
SHARED Status crossing_factor(Solver *s, double t, const double *y, double off);

/* Appends the rows that depend on each other, of those that were factored last, and how many they are. */
SHARED int crossing_name_rows(Solver *s, Why *text);

/* begins: FAILED, with why: the start lies in such a configuration, or too near for multipliers to have digits.  Reached by
 * OPTIONAL: an FMU with less than two rows has none. */
typedef struct {
    void (*layout)(Solver *s, Arena *scratch);
    Status (*begins)(Solver *s);
} Crossing;

SHARED const Crossing CROSSING;

#endif

/* column.h -- the columns of a run's derivatives (variation.h): where they stand (state.h: what stands in one). */
#ifndef LAGFMU_COLUMN_H
#define LAGFMU_COLUMN_H

#include "solver.h"

#include <string.h>

static inline double *column_at(const Solver *s, int c) {
    return s->state.variation + c * column_size(s->system);
}

/* dy/dp of all columns behind the state of y (solver_width()), and back. */
static inline void columns_gather(const Solver *s, double *y) {
    const int n = system_states(s->system);
    for (int c = 0; c < s->columns; c++) memcpy(y + n * (1 + c), column_at(s, c), (size_t)n * sizeof *y);
}
static inline void columns_scatter(Solver *s, const double *y) {
    const int n = system_states(s->system);
    for (int c = 0; c < s->columns; c++) memcpy(column_at(s, c), y + n * (1 + c), (size_t)n * sizeof *y);
}

#endif

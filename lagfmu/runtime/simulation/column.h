/* column.h -- what stands where in a column of a run's derivatives (variation.h). */
#ifndef LAGFMU_COLUMN_H
#define LAGFMU_COLUMN_H

#include "solver.h"

#include <string.h>

/* A column: y; of each event time, q, v; impulses; offsets; the energy dissipated. */
static inline int column_of_event(const System *s, EventKind kind, int i) {
    int at = system_states(s);
    for (int k = 0; k < (int)kind; k++) at += event_count_of(s, (EventKind)k) * (1 + system_states(s));
    return at + i * (1 + system_states(s));
}
static inline int column_of_impulse(const System *s, int c) { return column_of_event(s, EVENT_KINDS, 0) + c; }
static inline int column_of_offset(const System *s, int k) { return column_of_impulse(s, s->contacts) + k; }
static inline int column_of_loss(const System *s) { return column_of_offset(s, s->m); }
static inline int column_size(const System *s) { return column_of_loss(s) + 1; }

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

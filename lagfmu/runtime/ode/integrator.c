/* integrator.c -- memory of the integrators, and putting one at a state. */
#include "integrator.h"

void integrator_layout(Integrator *i, Arena *saved, Arena *scratch, int ny, int watched,
                       const Method *const *methods, int count) {
    int dense = 0, doubles = 0, ints = 0;
    for (int k = 0; k < count; k++) {
        const Method *method = methods[k];
        if (method == NULL) continue;
        const int matrices = watched <= RADAU_MOST_STATES ? method->scratch_matrices : 0;
        const int more = method->scratch_arrays * ny + matrices * watched * watched, pivots = matrices * watched;
        if (method->dense_arrays > dense) dense = method->dense_arrays;
        if (more > doubles) doubles = more;
        if (pivots > ints) ints = pivots;
    }
    i->ny = ny;
    i->watched = watched;
    i->y = arena_doubles(saved, ny);
    i->f = arena_doubles(saved, ny);
    i->y_old = arena_doubles(saved, ny);
    i->f_old = arena_doubles(saved, ny);
    i->dense = arena_doubles(saved, dense * ny);
    i->scratch = arena_doubles(scratch, doubles);
    i->pivots = arena_ints(scratch, ints);
}

void integrator_start(Integrator *i, const Method *method, double t, const double *y, double h) {
    i->method = method;
    i->t_old = i->t = t;
    i->h_next = h;
    i->error_old = i->error = 0;
    i->fresh = 1;
    i->fixed_left = 0;
    for (int j = 0; j < i->ny; j++) {
        i->y[j] = i->y_old[j] = y[j];
        i->f[j] = i->f_old[j] = 0;
    }
    for (int j = 0; j < method->dense_arrays * i->ny; j++) i->dense[j] = 0;
}

void integrator_move(Integrator *i, const double *y) {
    int same = 1;
    for (int j = 0; j < i->ny; j++) {
        same = same && i->y[j] == y[j];
        i->y[j] = y[j];
    }
    if (!same) i->fresh = 1;
}

/* equations.c -- what does not depend on the linear algebra: evaluation and sparse products. */
#include "equations.h"

#include <stddef.h>

void rows_times(const System *s, const double *G, double sign, const double *x, double *y) {
    for (int e = 0; e < s->entries; e++)
        y[s->entry_row[e]] += sign * G[e] * x[s->entry_column[e]];
}

void columns_times(const System *s, const double *G, double sign, const double *x, double *y) {
    for (int e = 0; e < s->entries; e++)
        y[s->entry_column[e]] += sign * G[e] * x[s->entry_row[e]];
}

void mass_times(const System *s, const double *M, double sign, const double *x, double *y) {
    for (int e = 0; e < s->masses; e++) {
        const int i = s->mass_row[e], j = s->mass_column[e];
        y[i] += sign * M[e] * x[j];
        if (i != j)
            y[j] += sign * M[e] * x[i];
    }
}

void equations_evaluate(Equations *e, double t, const double *q, const double *v) {
    e->s->dynamics(t, q, v, NULL, e->p, e->M, e->F, e->G, e->nu, e->gamma);
    e->evaluations++;
}

int equations_motion(Equations *e, double t, const double *q, const double *v, double *vdot,
                     double *lambda) {
    equations_evaluate(e, t, q, v);
    if (equations_factor(e) != 0)
        return 1;
    return equations_solve(e, e->F, e->gamma, vdot, lambda);
}

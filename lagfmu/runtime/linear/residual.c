/* residual.c -- r = b + G^T lambda - M x and g = c - G x from the lists of M and G, in working and
 * in doubled precision (Higham, Accuracy and Stability of Numerical Algorithms, sect. 12.1:
 * refinement with residuals in doubled precision gives x to working precision while cond * eps <
 * 1). */
#include "residual.h"

#include "doubled.h"
#include "schur.h"

void linear_residual(const Linear *l, const double *b, const double *c, const double *x,
                     const double *lambda, double *r, double *g) {
    const System *s = l->system;
    for (int i = 0; i < s->n; i++) r[i] = b != NULL ? b[i] : 0;
    for (int a = 0; a < s->masses; a++) {
        int i = s->mass_row[a], j = s->mass_column[a];
        r[i] -= l->M[a] * x[j];
        if (i != j) r[j] -= l->M[a] * x[i];
    }
    for (int k = 0; k < s->m; k++) {
        g[k] = 0;
        if (!l->active[k]) continue;
        double sum = c[k];
        for (int a = s->row_start[k]; a < s->row_start[k + 1]; a++) {
            int j = s->entry_column[a];
            sum -= l->G[a] * x[j];
            r[j] += l->G[a] * lambda[k];
        }
        g[k] = sum;
    }
}

/* r_i <- r_i + a x in doubled precision. */
static void accumulate(double *r, double *r_low, int i, double a, Doubled x) {
    Doubled sum = {r[i], r_low[i]};
    sum = doubled_add_product(sum, a, x);
    r[i] = sum.high;
    r_low[i] = sum.low;
}

void residual_doubled(const Linear *l, const double *b, const double *c, const double *x,
                      const double *x_low, const double *lambda, const double *lambda_low,
                      double *r, double *r_low, double *g) {
    const System *s = l->system;
    for (int i = 0; i < s->n; i++) {
        r[i] = b != NULL ? b[i] : 0;
        r_low[i] = 0;
    }
    for (int a = 0; a < s->masses; a++) {
        int i = s->mass_row[a], j = s->mass_column[a];
        Doubled x_i = {x[i], x_low[i]}, x_j = {x[j], x_low[j]};
        accumulate(r, r_low, i, -l->M[a], x_j);
        if (i != j) accumulate(r, r_low, j, -l->M[a], x_i);
    }
    for (int k = 0; k < s->m; k++) {
        g[k] = 0;
        if (!l->active[k]) continue;
        Doubled sum = {c[k], 0}, multiplier = {lambda[k], lambda_low[k]};
        for (int a = s->row_start[k]; a < s->row_start[k + 1]; a++) {
            int j = s->entry_column[a];
            Doubled x_j = {x[j], x_low[j]};
            sum = doubled_add_product(sum, -l->G[a], x_j);
            accumulate(r, r_low, j, l->G[a], multiplier);
        }
        g[k] = sum.high + sum.low;
    }
    for (int i = 0; i < s->n; i++) r[i] += r_low[i];
}

void doubled_move(int n, double *z, double *z_low, const double *d) {
    for (int i = 0; i < n; i++) {
        Doubled sum = {z[i], z_low[i]};
        sum = doubled_add(sum, d[i]);
        z[i] = sum.high;
        z_low[i] = sum.low;
    }
}

void refine(Linear *l, Substitute substitute, const double *b, const double *c, double *x,
            double *lambda) {
    const System *s = l->system;
    const Schur *own = schur_of(l);
    for (int i = 0; i < s->n; i++) own->x_low[i] = 0;
    for (int k = 0; k < s->m; k++) own->lambda_low[k] = 0;
    for (int step = 0; step < 3; step++) {
        residual_doubled(l, b, c, x, own->x_low, lambda, own->lambda_low, own->r, own->r_low,
                         own->g);
        substitute(l, own->r, own->g, own->dx, own->dlambda);
        doubled_move(s->n, x, own->x_low, own->dx);
        doubled_move(s->m, lambda, own->lambda_low, own->dlambda);
    }
}

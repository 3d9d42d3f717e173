/* refinement.c -- r = b + G^T lambda - M x (nv) and g = c - G x (m; 0 where a row does not act), in working and
 * in doubled precision, and the corrections that follow from them (Higham, Accuracy and Stability of Numerical
 * Algorithms, sect. 12.1: with residuals in doubled precision x is right to working precision while
 * cond * eps < 1). */
#include "refinement.h"

#include "doubled.h"

void refinement_layout(Linear *l, Arena *arena) {
    const int n = l->system->nv, m = l->system->m;
    l->refinement.x_low = arena_doubles(arena, n);
    l->refinement.lambda_low = arena_doubles(arena, m);
    l->refinement.r = arena_doubles(arena, n);
    l->refinement.r_low = arena_doubles(arena, n);
    l->refinement.g = arena_doubles(arena, m);
    l->refinement.dx = arena_doubles(arena, n);
    l->refinement.dlambda = arena_doubles(arena, m);
}

static void working_residual(const Linear *l, const double *b, const double *c, const double *x,
                             const double *lambda) {
    const System *s = l->system;
    double *r = l->refinement.r, *g = l->refinement.g;
    for (int i = 0; i < s->nv; i++) r[i] = b != NULL ? b[i] : 0;
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

/* Of x + x_low and lambda + lambda_low, each product and sum in doubled precision. */
static void doubled_residual(const Linear *l, const double *b, const double *c, const double *x,
                             const double *lambda) {
    const System *s = l->system;
    const double *x_low = l->refinement.x_low, *lambda_low = l->refinement.lambda_low;
    double *r = l->refinement.r, *r_low = l->refinement.r_low, *g = l->refinement.g;
    for (int i = 0; i < s->nv; i++) {
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
    for (int i = 0; i < s->nv; i++) r[i] += r_low[i];
}

/* z + z_low <- z + z_low + d */
static void move_doubled(int n, double *z, double *z_low, const double *d) {
    for (int i = 0; i < n; i++) {
        Doubled sum = {z[i], z_low[i]};
        sum = doubled_add(sum, d[i]);
        z[i] = sum.high;
        z_low[i] = sum.low;
    }
}

void refine_begin(Linear *l) {
    for (int i = 0; i < l->system->nv; i++) l->refinement.x_low[i] = 0;
    for (int k = 0; k < l->system->m; k++) l->refinement.lambda_low[k] = 0;
}

void refine_once(Linear *l, Substitute substitute, int doubled, const double *b, const double *c, double *x,
                 double *lambda) {
    const System *s = l->system;
    const Refinement *own = &l->refinement;
    (doubled ? doubled_residual : working_residual)(l, b, c, x, lambda);
    substitute(l, own->r, own->g, own->dx, own->dlambda);
    if (doubled) {
        move_doubled(s->nv, x, own->x_low, own->dx);
        move_doubled(s->m, lambda, own->lambda_low, own->dlambda);
    } else {
        for (int i = 0; i < s->nv; i++) x[i] += own->dx[i];
        for (int k = 0; k < s->m; k++) lambda[k] += own->dlambda[k];
    }
}

void refine(Linear *l, Substitute substitute, const double *b, const double *c, double *x,
            double *lambda) {
    refine_begin(l);
    for (int step = 0; step < 3; step++) refine_once(l, substitute, 1, b, c, x, lambda);
}

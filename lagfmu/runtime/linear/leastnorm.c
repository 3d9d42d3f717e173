/* leastnorm.c -- dependent constraints and a coordinate without mass together: the solution of
 * least norm of the KKT matrix, in rows and columns scaled by 1 / sqrt of their largest elements
 * (Golub & Van Loan, Matrix Computations, sect. 5.5.2):
 *
 *   K = [M G^T; G 0] = Q [T^T 0; 0 0] Z^T ,   K [x; -lambda] = [b; c] ,
 *   [x; -lambda] = Z1 T^-T Q1^T [b; c]
 *
 * Z2 spans the null space of K.  x must not take part in it, and lambda_k is unique if it does
 * not. */
#include "dependent.h"

#include <math.h>

#include "cod.h"
#include "kkt.h"
#include "numbers.h"
#include "refinement.h"
#include "thresholds.h"

/* The scaled KKT matrix of the rows that act, decomposed. */
typedef struct {
    Cod cod;
    double *scale, *z, *spare; /* (n + m) */
    int *rank;
    int *place;                /* (m) where each row that acts stands */
} Whole;

size_t least_norm_doubles(int n, int m) {
    return cod_doubles(n + m, n + m) + 3 * (size_t)(n + m);
}

int least_norm_ints(int n, int m) { return cod_ints(n + m, n + m) + m + 1; }

static Whole whole_view(const Linear *l) {
    int n = l->system->nv, m = l->system->m, size = n;
    Whole w;
    w.scale = l->dense;
    w.z = w.scale + n + m;
    w.spare = w.z + n + m;
    w.rank = l->pivots;
    w.place = l->pivots + 1;
    for (int k = 0; k < m; k++)
        if (l->active[k]) w.place[k] = size++;
    cod_place(&w.cod, size, size, w.spare + n + m, w.place + m);
    w.cod.rank = *w.rank;
    return w;
}

/* 1 / sqrt of the largest element of each row, 1 for a row of zeros, in a unit of mass in which the largest element of M is
 * then 1: lambda grows with it, and x stays. */
static void scale_rows(const Linear *l, const Whole *w) {
    const System *s = l->system;
    for (int i = 0; i < w->cod.rows; i++) w->scale[i] = 0;
    for (int a = 0; a < s->masses; a++) {
        int i = s->mass_row[a], j = s->mass_column[a];
        w->scale[i] = fmax(w->scale[i], fabs(l->M[a]));
        w->scale[j] = fmax(w->scale[j], fabs(l->M[a]));
    }
    for (int a = 0; a < s->entries; a++) {
        if (!l->active[s->entry_row[a]]) continue;
        int i = w->place[s->entry_row[a]], j = s->entry_column[a];
        w->scale[i] = fmax(w->scale[i], fabs(l->G[a]));
        w->scale[j] = fmax(w->scale[j], fabs(l->G[a]));
    }
    for (int i = 0; i < w->cod.rows; i++) w->scale[i] = w->scale[i] > 0 ? 1 / sqrt(w->scale[i]) : 1;
    double most = 0;
    for (int a = 0; a < s->masses; a++)
        most = fmax(most, fabs(l->M[a]) * w->scale[s->mass_row[a]] * w->scale[s->mass_column[a]]);
    const double unit = most > 0 ? sqrt(most) : 1;
    for (int i = 0; i < w->cod.rows; i++) w->scale[i] *= i < s->nv ? 1 / unit : unit;
}

Status least_norm_factor(Linear *l) {
    *l->pivots = 0;
    Whole w = whole_view(l);
    int n = l->system->nv;
    scale_rows(l, &w);
    kkt_matrix(l, w.scale, w.place, w.cod.A);
    cod_factor(&w.cod, linear_rank_threshold(l));
    *w.rank = w.cod.rank;
    for (int j = w.cod.rank; j < w.cod.columns; j++) {
        for (int i = 0; i < w.cod.columns; i++) w.z[i] = i == j;
        cod_from_rows(&w.cod, w.z, w.spare);
        if (!l->nearest && largest(n, w.z) > VANISHES) {
            const char *comma = " (";
            (void)fail(l->why,
                       "the mass matrix is singular on the constraint surface: a coordinate has "
                       "neither mass nor a constraint that determines its acceleration");
            for (int i = 0; i < n; i++) {
                if (!(fabs(w.z[i]) > VANISHES)) continue;
                why_append(l->why, "%s%s", comma, l->system->speeds[i]);
                comma = ", ";
            }
            why_append(l->why, ")");
            return FAILED;
        }
        for (int k = 0; k < l->system->m; k++)
            if (l->active[k] && !(fabs(w.z[w.place[k]]) < VANISHES)) l->unique[k] = 0;
    }
    return OK;
}

/* z <- Q^T of the scaled right-hand sides; returns their largest element. */
static double right(const Linear *l, const Whole *w, const double *b, const double *c) {
    for (int i = 0; i < l->system->nv; i++) w->z[i] = b != NULL ? b[i] * w->scale[i] : 0;
    for (int k = 0; k < l->system->m; k++)
        if (l->active[k]) w->z[w->place[k]] = c[k] * w->scale[w->place[k]];
    double most = largest(w->cod.rows, w->z);
    cod_to_range(&w->cod, w->z);
    return most;
}

static void substitute_least(Linear *l, const double *b, const double *c, double *x, double *lambda) {
    Whole w = whole_view(l);
    right(l, &w, b, c);
    cod_solve_transposed(&w.cod, w.z);
    for (int i = w.cod.rank; i < w.cod.columns; i++) w.z[i] = 0;
    cod_from_rows(&w.cod, w.z, w.spare);
    for (int i = 0; i < l->system->nv; i++) x[i] = w.z[i] * w.scale[i];
    for (int k = 0; k < l->system->m; k++)
        lambda[k] = l->active[k] ? -w.z[w.place[k]] * w.scale[w.place[k]] : 0;
}

Status least_norm_solve(Linear *l, const double *b, const double *c, double *x, double *lambda) {
    Whole w = whole_view(l);
    double most = right(l, &w, b, c);
    for (int i = w.cod.rank; i < w.cod.rows && !l->nearest && !(l->off > ON_CONSTRAINTS); i++)
        if (fabs(w.z[i]) > CONSISTENT * most)
            return linear_contradicted(l);
    substitute_least(l, b, c, x, lambda);
    refine(l, substitute_least, b, c, x, lambda);
    return OK;
}

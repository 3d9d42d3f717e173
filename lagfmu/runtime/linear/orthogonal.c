/* orthogonal.c -- dependent constraints: multipliers of least norm (weighted.c), refined.
 *
 * W = Q [T^T 0; 0 0] Z^T: Z2 spans the null space of G^T, in rows with g_k M^-1 g_k^T = 1.  The
 * equations contradict each other unless Z2^T c = 0; lambda_k is unique if row k of Z2 vanishes
 * (Wojtyra, Multibody System Dynamics 13 (2005) 265). */
#include "dependent.h"

#include <math.h>

#include "numbers.h"
#include "refinement.h"
#include "thresholds.h"
#include "weighted.h"

int orthogonal_factor(Linear *l, int *doubtful) {
    Weighted w;
    if (!weighted_factor(l, linear_rank_threshold(l), &w)) return 0;
    *doubtful = w.cod.rank < w.acting && w.hides;
    for (int j = w.cod.rank; j < w.acting; j++) {
        for (int i = 0; i < w.acting; i++) w.w[i] = i == j;
        cod_from_rows(&w.cod, w.w, w.spare);
        for (int i = 0; i < w.acting; i++)
            if (!(fabs(w.w[i]) < VANISHES)) l->unique[w.rows[i]] = 0;
    }
    return 1;
}

/* Whether the dependent rows agree, measured by the terms of W^T z = c: c, y and z. */
static int consistent(const Linear *l, const double *b, const double *c) {
    Weighted w = weighted_view(l);
    int n = l->system->nv;
    if (w.cod.rank == w.acting) return 1;
    double terms = 0;
    for (int j = 0; j < w.acting; j++) terms = fmax(terms, fabs(c[w.rows[j]] / w.size[j]));
    weighted_to(l, &w, b, w.y);
    terms += largest(n, w.y);
    weighted_rows(&w, c);
    for (int i = 0; i < w.cod.rank; i++) w.y[i] = w.w[i];
    terms += largest(n, w.y);
    for (int j = w.cod.rank; j < w.acting; j++)
        if (fabs(w.w[j]) > CONSISTENT * terms) return 0;
    return 1;
}

Status orthogonal_solve(Linear *l, const double *b, const double *c, double *x, double *lambda) {
    if (!l->nearest && !(l->off > ON_CONSTRAINTS) && !consistent(l, b, c))
        return linear_contradicted(l);
    weighted_solve(l, b, c, x, lambda);
    refine(l, weighted_solve, b, c, x, lambda);
    return OK;
}

/* dependent.c -- the rungs that only constraints need, as linear.c climbs them. */
#include "dependent.h"

#include <math.h>

#include "cod.h"
#include "numbers.h"
#include "weighted.h"

static const double SAFE = 1e-6; /* rows of unit norm must stand out by this much to be eliminated */

static size_t doubles(int n, int m) {
    return larger_size(weighted_doubles(n, m), least_norm_doubles(n, m));
}

static size_t ints(int n, int m) {
    return larger_size((size_t)weighted_ints(n, m), (size_t)least_norm_ints(n, m));
}

static int keep_rows(Linear *l, const int *kept) { return kept_factor(l, kept); }

static int solve_kept(Linear *l, const double *b, const double *c, double *x, double *lambda) {
    return kept_solve(l, b, c, x, lambda);
}

/* lambda eliminated from M x = b + G^T lambda (ME 6590, eq. 9):  with G N = 0,
 *
 *   N^T (M x - b) = 0 ,   G x = c ,
 *
 * and lambda recovered afterwards from G^T lambda = M x - b.  The columns of N = L^-T D^-1/2 Q2 (weighted.c) are
 * orthonormal in the metric of M, N^T M x = Q2^T z, N^T b = Q2^T y: for independent rows these are the equations
 * that weighted_solve() solves. */
static int factor_nullspace(Linear *l) {
    Weighted w;
    if (!weighted_factor(l, SAFE, &w) || w.acting == 0 || w.cod.rank < w.acting) return 0;
    l->rung = RUNG_NULLSPACE;
    return 1;
}

/* In the metric of M light coordinates hide what the others are held by; in the KKT matrix they do not. */
static Status factor_rows(Linear *l) {
    int doubtful;
    l->rung = RUNG_ORTHOGONAL;
    if (orthogonal_factor(l, &doubtful)) {
        if (!doubtful) return OK;
        const int rank = l->system->nv + *l->pivots;
        for (int k = 0; k < l->system->m; k++) l->unique[k] = 1;
        l->rung = RUNG_LEAST_NORM;
        if (least_norm_factor(l) == OK && *l->pivots >= rank) return OK;
        for (int k = 0; k < l->system->m; k++) l->unique[k] = 1;
        l->rung = RUNG_ORTHOGONAL;
        (void)orthogonal_factor(l, &doubtful);
        return OK;
    }
    l->rung = RUNG_LEAST_NORM;
    return least_norm_factor(l);
}

static Status solve_rows(Linear *l, const double *b, const double *c, double *x, double *lambda) {
    if (l->rung == RUNG_ORTHOGONAL) return orthogonal_solve(l, b, c, x, lambda);
    if (l->rung == RUNG_LEAST_NORM) return least_norm_solve(l, b, c, x, lambda);
    weighted_solve(l, b, c, x, lambda);
    return OK;
}

/* G^T itself, its columns scaled: where M is singular there is no metric. */
static int basis_unweighted(Linear *l, int *basis) {
    const System *s = l->system;
    Cod cod;
    int acting = 0, *rows = l->pivots;
    for (int k = 0; k < s->m; k++)
        if (l->active[k]) rows[acting++] = k;
    cod_place(&cod, s->nv, acting, l->dense, rows + s->m);
    for (int j = 0; j < acting; j++) {
        double *column = cod.A + j * s->nv, sum = 0;
        for (int i = 0; i < s->nv; i++) column[i] = 0;
        for (int e = s->row_start[rows[j]]; e < s->row_start[rows[j] + 1]; e++)
            sum = fmax(sum, fabs(l->G[e]));
        for (int e = s->row_start[rows[j]]; e < s->row_start[rows[j] + 1]; e++)
            column[s->entry_column[e]] = l->G[e] / (sum > 0 ? sum : 1);
    }
    cod_factor(&cod, linear_rank_threshold(l));
    for (int j = cod.rank; j < acting; j++) basis[rows[cod.column[j]]] = 0;
    return cod.rank < acting;
}

static int basis(Linear *l, int *rows) {
    if (l->rung == RUNG_KEPT) return kept_basis(l, rows);
    if (l->rung == RUNG_LEAST_NORM) return basis_unweighted(l, rows);
    const Weighted w = weighted_view(l);
    for (int j = w.cod.rank; j < w.acting; j++) rows[w.rows[w.cod.column[j]]] = 0;
    return w.cod.rank < w.acting;
}

/* Of columns of unit norm, the one that stands out least comes last. */
static double apart(const Linear *l) {
    const Weighted w = weighted_view(l);
    const int last = w.cod.rank - 1;
    return last < 0 ? 1 : fabs(w.cod.A[last * w.cod.rows + last]);
}

static const Dependent ALL = {doubles, ints, keep_rows, solve_kept, factor_nullspace, factor_rows, solve_rows, basis, apart};
SHARED_VALUE const Dependent *const DEPENDENT = &ALL;

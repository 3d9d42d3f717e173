/* weighted.c -- accelerations and multipliers by an orthogonal decomposition in the metric of M.
 *
 * With M = L D L^T, z = D^1/2 L^T x, y = D^-1/2 L^-1 b and W = D^-1/2 L^-1 G^T, its columns scaled
 * to unit norm (rows in which g_k M^-1 g_k^T = 1),
 *
 *   z = y + W lambda ,  W^T z = c ;      W = Q [T^T 0; 0 0] Z^T ,
 *   Q1^T z = T^-1 Z1^T c ,  Q2^T z = Q2^T y ,  lambda = Z1 T^-T (Q1^T z - Q1^T y)
 *
 * is the solution, of least norm if W has not full rank (Golub & Van Loan, Matrix Computations,
 * sect. 5.5.2 and 6.2).  Without the metric of M digits are lost at extreme ratios of masses. */
#include "weighted.h"

#include <math.h>

#include "schur.h"
#include "thresholds.h"

size_t weighted_doubles(int n, int m) {
    return cod_doubles(n, m) + (size_t)n + 3 * (size_t)m;
}

int weighted_ints(int n, int m) { return cod_ints(n, m) + m + 1; }

Weighted weighted_view(const Linear *l) {
    int n = l->system->nv, m = l->system->m;
    Weighted w;
    w.size = l->dense;
    w.y = w.size + m;
    w.w = w.y + n;
    w.spare = w.w + m;
    w.rank = l->pivots;
    w.rows = l->pivots + 1;
    w.acting = 0;
    for (int k = 0; k < m; k++)
        if (l->active[k]) w.rows[w.acting++] = k;
    cod_place(&w.cod, n, w.acting, w.spare + m, w.rows + m);
    w.cod.rank = *w.rank;
    return w;
}

int weighted_factor(Linear *l, double threshold, Weighted *w) {
    if (!schur_masses(l, 1)) return 0;
    *l->pivots = 0;
    *w = weighted_view(l);
    const Schur *own = schur_of(l);
    int n = l->system->nv;
    w->hides = 0;
    for (int j = 0; j < w->acting; j++) {
        int k = w->rows[j];
        double *column = w->cod.A + j * n;
        for (int i = 0; i < n; i++) column[i] = 0;
        w->size[j] = own->diagonal[k] > 0 ? sqrt(own->diagonal[k]) : 1;
        double most = 0;
        for (int a = own->w_start[k]; a < own->w_start[k + 1]; a++) most = fmax(most, fabs(own->w[a]));
        for (int a = own->w_start[k]; a < own->w_start[k + 1]; a++) {
            int i = own->w_column[a];
            column[i] = own->w[a] * sqrt(own->inverse_mass[i]) / w->size[j];
            w->hides |= fabs(own->w[a]) > HIDES * most && fabs(column[i]) < HIDDEN;
        }
    }
    cod_factor(&w->cod, threshold);
    *w->rank = w->cod.rank;
    return 1;
}

void weighted_to(const Linear *l, const Weighted *w, const double *b, double *y) {
    const Schur *own = schur_of(l);
    int n = l->system->nv;
    for (int i = 0; i < n; i++) y[i] = 0;
    if (b == NULL) return;
    schur_half(l, b, y);
    for (int i = 0; i < n; i++) y[i] /= sqrt(own->inverse_mass[i]);
    cod_to_range(&w->cod, y);
}

void weighted_from(const Linear *l, const Weighted *w, double *y, double *x) {
    const Schur *own = schur_of(l);
    int n = l->system->nv;
    cod_from_range(&w->cod, y);
    for (int i = 0; i < n; i++) y[i] *= sqrt(own->inverse_mass[i]);
    schur_back(l, y, x);
}

void weighted_rows(const Weighted *w, const double *c) {
    for (int j = 0; j < w->acting; j++) w->w[j] = c[w->rows[j]] / w->size[j];
    cod_to_rows(&w->cod, w->w, w->spare);
    cod_solve(&w->cod, w->w);
}

void weighted_solve(Linear *l, const double *b, const double *c, double *x, double *lambda) {
    Weighted w = weighted_view(l);
    weighted_to(l, &w, b, w.y);
    weighted_rows(&w, c);
    for (int i = 0; i < w.cod.rank; i++) {
        double z = w.w[i];
        w.w[i] -= w.y[i];
        w.y[i] = z;
    }
    weighted_from(l, &w, w.y, x);
    cod_solve_transposed(&w.cod, w.w);
    for (int j = w.cod.rank; j < w.acting; j++) w.w[j] = 0;
    cod_from_rows(&w.cod, w.w, w.spare);
    for (int k = 0; k < l->system->m; k++) lambda[k] = 0;
    for (int j = 0; j < w.acting; j++) lambda[w.rows[j]] = w.w[j] / w.size[j];
}

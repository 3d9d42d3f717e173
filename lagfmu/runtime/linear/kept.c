/* kept.c -- dependent constraints by the factors of those that stand for all.  Of W = D^-1/2 L^-1 P G^T, its columns of
 * unit norm (weighted.c), B are those of the basis; every other column is
 *
 *   w = W_B u ,  W_B^T W_B u = W_B^T w ,  so that [u; -1] spans, with those of all others, the null space Z2 of W.
 *
 * 1 - Z2 Z2^T leaves of right-hand sides what the equations can meet, and of multipliers those of least norm, as the
 * complete decomposition does (orthogonal.c).  What is left of w - W_B u tells the rank: where that, or the metric of M
 * (HIDES), is in doubt, the decomposition is asked. */
#include "dependent.h"

#include <math.h>
#include <string.h>

#include "numbers.h"
#include "schur.h"
#include "thresholds.h"

static const double SURELY = 0.1;  /* of a threshold: what is below it by so much is so by the decomposition too */
static const double DISTINCT = 1e-3; /* part of a null vector that those before it must leave */

/* In Linear.dense and Linear.pivots, which hold more than that for the rungs above. */
typedef struct {
    double *size;       /* (m) norm of each row in the metric of M */
    double *w, *u, *y;  /* (m), (m), (nv) scratch */
    double *Z;          /* (count, m) null vectors, orthonormal */
    int *count, *basis; /* (m) */
} Kept;

static Kept kept_view(const Linear *l) {
    const int m = l->system->m;
    Kept k;
    k.size = l->dense;
    k.w = k.size + m;
    k.u = k.w + m;
    k.y = k.u + m;
    k.Z = k.y + l->system->nv;
    k.count = l->pivots;
    k.basis = l->pivots + 1;
    return k;
}

/* As in weighted.c: a light coordinate leaves next to nothing of others in a row. */
static int hides(const Linear *l) {
    const Schur *own = schur_of(l);
    for (int k = 0; k < l->system->m; k++) {
        if (!l->active[k]) continue;
        const int from = own->w_start[k], to = own->w_start[k + 1];
        const double hidden = HIDDEN * HIDDEN * own->diagonal[k];
        double most = 0;
        for (int a = from; a < to; a++) most = larger(most, fabs(own->w[a]));
        for (int a = from; a < to; a++)
            if (fabs(own->w[a]) > HIDES * most && own->w[a] * own->h[a] < hidden) return 1;
    }
    return 0;
}

/* z (m) <- the null vector of row d; 0 if it may be none. */
static int null_vector(Linear *l, const Kept *x, int d, double *z) {
    const int n = l->system->nv, m = l->system->m;
    const Schur *own = schur_of(l);
    double left = 0;
    schur_begin_row(l, d, x->y);
    schur_express(l, x->y, z);
    schur_express(l, x->y, x->u); /* digits that the condition of W_B has cost */
    for (int i = 0; i < n; i++) left += x->y[i] * x->y[i] / own->inverse_mass[i];
    const double doubt = SURELY * linear_rank_threshold(l) * x->size[d];
    if (!(left <= doubt * doubt)) return 0;
    for (int k = 0; k < m; k++) z[k] = (z[k] + x->u[k]) * x->size[k];
    z[d] = x->size[d];
    const double whole = dot(m, z, z);
    for (int round = 0; round < 2; round++) /* twice is enough (Kahan) */
        for (const double *before = x->Z; before < z; before += m) add_part(m, -dot(m, before, z), before, z);
    const double rest = dot(m, z, z), part = 1 / sqrt(rest);
    for (int k = 0; k < m; k++) z[k] *= part;
    return rest > DISTINCT * DISTINCT * whole;
}

static int find_null_vectors(Linear *l) {
    const Kept x = kept_view(l);
    const int m = l->system->m;
    const double *diagonal = schur_of(l)->diagonal;
    for (int k = 0; k < m; k++) x.size[k] = l->active[k] ? sqrt(diagonal[k]) : 0;
    *x.count = 0;
    for (int d = 0; d < m; d++) {
        double *z = x.Z + *x.count * m;
        if (!l->active[d] || x.basis[d]) continue;
        if (!null_vector(l, &x, d, z)) return 0;
        for (int k = 0; k < m; k++)
            if (!(fabs(z[k]) < VANISHES)) l->unique[k] = 0;
        *x.count += 1;
    }
    return 1;
}

int kept_factor(Linear *l, const int *basis) {
    const Kept x = kept_view(l);
    const int m = l->system->m, *some = l->some;
    int others = 0;
    for (int k = 0; k < m; k++) {
        if (basis[k] && !l->active[k]) return 0;
        others += l->active[k] && !basis[k];
    }
    if (others == 0) return 0;
    memcpy(x.basis, basis, (size_t)m * sizeof *basis);
    l->some = x.basis;
    const int found = schur_factor(l) && !hides(l) && find_null_vectors(l);
    l->some = some;
    return found;
}

/* w (m) <- (1 - Z2 Z2^T) w ; the largest part that was taken away. */
static double leave_range(const Kept *x, int m, double *w) {
    double most = 0;
    for (int j = 0; j < *x->count; j++) {
        const double *z = x->Z + j * m, part = dot(m, z, w);
        most = larger(most, fabs(part));
        add_part(m, -part, z, w);
    }
    return most;
}

/* Whether the dependent rows surely agree: `missed` against the terms of W^T z = c, c itself and the forces. */
static int agree(const Linear *l, const Kept *x, const double *b, double missed, double terms) {
    if (missed <= SURELY * CONSISTENT * terms) return 1;
    if (b == NULL) return 0;
    schur_half(l, b, x->y);
    for (int i = 0; i < l->system->nv; i++) x->y[i] /= sqrt(schur_of(l)->inverse_mass[i]);
    return missed <= SURELY * CONSISTENT * (terms + largest(l->system->nv, x->y));
}

int kept_solve(Linear *l, const double *b, const double *c, double *x, double *lambda) {
    const Kept own = kept_view(l);
    const int m = l->system->m, *active = l->active, *some = l->some;
    for (int k = 0; k < m; k++) own.w[k] = active[k] ? c[k] / own.size[k] : 0;
    const double terms = largest(m, own.w), missed = leave_range(&own, m, own.w);
    if (!l->nearest && !(l->off > ON_CONSTRAINTS) && !agree(l, &own, b, missed, terms)) return 0;
    for (int k = 0; k < m; k++) own.w[k] *= own.size[k];
    l->active = l->some = own.basis;
    const int settled = schur_solve(l, b, own.w, x, lambda);
    l->active = active;
    l->some = some;
    for (int k = 0; k < m; k++) own.w[k] = lambda[k] * own.size[k];
    (void)leave_range(&own, m, own.w);
    for (int k = 0; k < m; k++) lambda[k] = active[k] ? own.w[k] / own.size[k] : 0;
    return settled;
}

int kept_basis(const Linear *l, int *basis) {
    memcpy(basis, kept_view(l).basis, (size_t)l->system->m * sizeof *basis);
    return 1;
}

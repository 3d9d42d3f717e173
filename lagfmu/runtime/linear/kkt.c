/* kkt.c -- the KKT matrix as a whole,
 *
 *   [ M  G^T ] [   x     ]   [ b ]
 *   [ G   0  ] [ -lambda ] = [ c ] ,
 *
 * its rows and columns scaled alike by powers of two until the largest element of each is near 1 (Ruiz, A scaling algorithm to equilibrate both rows and columns norms, 2001), then LU with
 * partial pivoting and refinement with residuals in doubled precision (Higham, Accuracy and
 * Stability of Numerical Algorithms, sect. 12.1).  Right for extreme ratios of masses and for a
 * coordinate without mass of its own. */
#include "kkt.h"

#include <math.h>

#include "condition.h"
#include "lu.h"
#include "refinement.h"
#include "schur.h"

static const double REGULAR = 1e-14; /* reciprocal condition above which K is not singular */

typedef struct {
    int size;
    double *A;      /* (size, size) */
    double *scale;  /* (n + m) */
    double *z;      /* (n + m) */
    double *work;   /* 2 (n + m) */
    int *place;     /* (m) where each row that acts stands in K */
    int *pivots;    /* (n + m) */
} Kkt;

size_t kkt_doubles(int n, int m) {
    size_t all = (size_t)n + (size_t)m;
    return all * all + 4 * all;
}

int kkt_ints(int n, int m) { return n + 2 * m; }

static Kkt view(const Linear *l) {
    int n = l->system->nv, m = l->system->m;
    Kkt k;
    k.scale = l->dense;
    k.z = k.scale + n + m;
    k.work = k.z + n + m;
    k.A = k.work + 2 * (n + m);
    k.place = l->pivots;
    k.pivots = l->pivots + m;
    k.size = n;
    for (int i = 0; i < m; i++)
        if (l->active[i]) k.place[i] = k.size++;
    return k;
}

int kkt_matrix(const Linear *l, const double *scale, const int *place, double *A) {
    const System *s = l->system;
    int size = s->nv;
    for (int k = 0; k < s->m; k++) size += l->active[k] != 0;
    for (int i = 0; i < size * size; i++) A[i] = 0;
    for (int a = 0; a < s->masses; a++) {
        int i = s->mass_row[a], j = s->mass_column[a];
        A[i * size + j] = A[j * size + i] = l->M[a] * scale[i] * scale[j];
    }
    for (int a = 0; a < s->entries; a++) {
        if (!l->active[s->entry_row[a]]) continue;
        int k = place[s->entry_row[a]], j = s->entry_column[a];
        A[k * size + j] = A[j * size + k] = l->G[a] * scale[k] * scale[j];
    }
    return size;
}

static double power_of_two(double size) { return size > 0 ? ldexp(1, -(int)rint(log2(size))) : 1; }

/* d: coordinates in the metric of their own masses, where they have one, so that no unit of mass counts
 * beside the constraints; then constraints to elements near 1. */
static void scale_first(const Linear *l, const int *place, double *d, int size) {
    const System *s = l->system;
    for (int i = 0; i < size; i++) d[i] = i < s->nv ? 1 : 0;
    for (int a = 0; a < s->masses; a++)
        if (s->mass_row[a] == s->mass_column[a] && l->M[a] > 0)
            d[s->mass_row[a]] = power_of_two(sqrt(l->M[a]));
    for (int a = 0; a < s->entries; a++)
        if (l->active[s->entry_row[a]]) {
            double *largest = &d[place[s->entry_row[a]]];
            *largest = fmax(*largest, fabs(l->G[a]) * d[s->entry_column[a]]);
        }
    for (int i = s->nv; i < size; i++) d[i] = power_of_two(d[i]);
}

/* Powers of two that bring the largest element of every row near 1; 0 if a row is zero. */
static int equilibrate(const Linear *l, const Kkt *k, int to_masses) {
    const System *s = l->system;
    double *d = k->scale, *largest = k->z;
    for (int i = 0; i < k->size; i++) d[i] = 1;
    if (to_masses) scale_first(l, k->place, d, k->size);
    for (int step = 0; step < 20; step++) {
        for (int i = 0; i < k->size; i++) largest[i] = 0;
        for (int a = 0; a < s->masses; a++) {
            int i = s->mass_row[a], j = s->mass_column[a];
            double size = fabs(l->M[a] * d[i] * d[j]);
            largest[i] = fmax(largest[i], size);
            largest[j] = fmax(largest[j], size);
        }
        for (int a = 0; a < s->entries; a++) {
            if (!l->active[s->entry_row[a]]) continue;
            int i = k->place[s->entry_row[a]], j = s->entry_column[a];
            double size = fabs(l->G[a] * d[i] * d[j]);
            largest[i] = fmax(largest[i], size);
            largest[j] = fmax(largest[j], size);
        }
        int even = 1;
        for (int i = 0; i < k->size; i++) {
            if (!(largest[i] > 0)) return 0;
            double excess = log2(largest[i]);
            d[i] = ldexp(d[i], -(int)rint(excess / 2));
            if (fabs(excess) > 1) even = 0;
        }
        if (even) break;
    }
    return 1;
}

static void solve_lu(void *context, double *x) {
    const Kkt *k = context;
    lu_solve(k->size, k->A, k->pivots, x);
}

static int factor_scaled(Linear *l, double least, int to_masses) {
    Kkt k = view(l);
    if (!equilibrate(l, &k, to_masses)) return 0;
    kkt_matrix(l, k.scale, k.place, k.A);
    double norm = 0;
    for (int i = 0; i < k.size; i++) {
        double sum = 0;
        for (int j = 0; j < k.size; j++) sum += fabs(k.A[i * k.size + j]);
        norm = fmax(norm, sum);
    }
    if (lu_factor(k.size, k.A, k.pivots) != 0) return 0;
    return norm * inverse_norm(k.size, solve_lu, &k, k.work) <= 1 / fmax(REGULAR, least);
}

/* As it is; and where that is singular though it may be the masses alone that are, from masses of 1 on: then
 * no unit of mass counts beside the constraints, but masses that differ much cost digits.  From masses of 1 on
 * also off the constraints, where it is asked how nearly rows depend on each other. */
int kkt_factor(Linear *l, double least) {
    if (least > 0 && schur_of(l)->definite) return factor_scaled(l, least, 1);
    return factor_scaled(l, least, 0) || (!schur_of(l)->definite && factor_scaled(l, least, 1));
}

static void substitute_scaled(Linear *l, const double *b, const double *c, double *x, double *lambda) {
    Kkt k = view(l);
    int n = l->system->nv, m = l->system->m;
    for (int i = 0; i < n; i++) k.z[i] = (b != NULL ? b[i] : 0) * k.scale[i];
    for (int i = 0; i < m; i++)
        if (l->active[i]) k.z[k.place[i]] = c[i] * k.scale[k.place[i]];
    lu_solve(k.size, k.A, k.pivots, k.z);
    for (int i = 0; i < n; i++) x[i] = k.z[i] * k.scale[i];
    for (int i = 0; i < m; i++)
        lambda[i] = l->active[i] ? -k.z[k.place[i]] * k.scale[k.place[i]] : 0;
}

void kkt_solve(Linear *l, const double *b, const double *c, double *x, double *lambda) {
    substitute_scaled(l, b, c, x, lambda);
    refine(l, substitute_scaled, b, c, x, lambda);
}

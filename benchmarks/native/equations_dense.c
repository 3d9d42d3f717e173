/* equations_dense.c -- Cholesky of M and of the Schur complement S = G M^-1 G^T, both dense:
 *
 *   M = L L^T ,  W = L^-1 G^T ,  S = W^T W ,  S lambda = c - G M^-1 b ,  x = M^-1 (b + G^T lambda)
 *
 * (Golub & Van Loan, Matrix Computations, sect. 4.2.)  A diagonal M is kept as its diagonal. */
#include <math.h>
#include <stdlib.h>

#include "equations.h"

typedef struct {
    int diagonal;  /* 1: M has no entry beside the diagonal */
    double *L;     /* (n, n), or its diagonal (n): 1 / M_jj */
    double *W;     /* (m, n): rows of G, solved with L; diagonal: divided by M_jj */
    double *S;     /* (m, m) */
    double *g;     /* (m, n) dense G, only for a diagonal M */
} Factors;

int equations_create(Equations *e, const System *s, const double *p) {
    const size_t n = (size_t)s->nv, m = (size_t)s->m;
    const size_t values = (size_t)(s->masses + s->entries) + n + 2 * m;
    Factors *f = calloc(1, sizeof *f);
    double *block = calloc(values + n * n + 2 * m * n + m * m + 1, sizeof(double));
    if (f == NULL || block == NULL)
        return 1;
    e->s = s;
    e->p = p;
    e->evaluations = 0;
    e->M = block;
    e->F = e->M + s->masses;
    e->G = e->F + n;
    e->nu = e->G + s->entries;
    e->gamma = e->nu + m;
    f->L = block + values;
    f->W = f->L + n * n;
    f->S = f->W + m * n;
    f->g = f->S + m * m;
    f->diagonal = 1;
    for (int k = 0; k < s->masses; k++)
        f->diagonal = f->diagonal && s->mass_row[k] == s->mass_column[k];
    e->factors = f;
    return 0;
}

void equations_destroy(Equations *e) {
    free(e->factors);
    free(e->M);
}

/* A = L L^T in the lower triangle of A. */
static int cholesky(int n, double *A) {
    for (int j = 0; j < n; j++) {
        double *row = A + j * n;
        for (int i = 0; i < j; i++) {
            double sum = row[i];
            for (int k = 0; k < i; k++)
                sum -= row[k] * A[i * n + k];
            row[i] = sum / A[i * n + i];
        }
        for (int k = 0; k < j; k++)
            row[j] -= row[k] * row[k];
        if (!(row[j] > 0))
            return 1;
        row[j] = sqrt(row[j]);
    }
    return 0;
}

static void forward(int n, const double *L, double *b) {
    for (int i = 0; i < n; i++) {
        for (int k = 0; k < i; k++)
            b[i] -= L[i * n + k] * b[k];
        b[i] /= L[i * n + i];
    }
}

static void backward(int n, const double *L, double *b) {
    for (int i = n - 1; i >= 0; i--) {
        b[i] /= L[i * n + i];
        for (int k = 0; k < i; k++)
            b[k] -= L[i * n + k] * b[i];
    }
}

static int factor_mass(Equations *e, Factors *f) {
    const System *s = e->s;
    const int n = s->nv;
    if (f->diagonal) {
        for (int j = 0; j < n; j++)
            f->L[j] = 0;
        for (int k = 0; k < s->masses; k++)
            f->L[s->mass_row[k]] = 1 / e->M[k];
        return 0;
    }
    for (int k = 0; k < n * n; k++)
        f->L[k] = 0;
    for (int k = 0; k < s->masses; k++)
        f->L[s->mass_row[k] * n + s->mass_column[k]] = e->M[k];
    return cholesky(n, f->L);
}

int equations_factor(Equations *e) {
    const System *s = e->s;
    Factors *f = e->factors;
    const int n = s->nv, m = s->m;
    if (factor_mass(e, f) != 0)
        return 1;
    for (int k = 0; k < m * n; k++)
        f->W[k] = f->g[k] = 0;
    for (int k = 0; k < s->entries; k++)
        f->W[s->entry_row[k] * n + s->entry_column[k]] = e->G[k];
    for (int i = 0; i < m; i++) {
        double *row = f->W + i * n;
        if (f->diagonal) {
            for (int j = 0; j < n; j++) {
                f->g[i * n + j] = row[j];
                row[j] *= f->L[j];
            }
        } else {
            forward(n, f->L, row);
        }
    }
    const double *right = f->diagonal ? f->g : f->W;
    for (int i = 0; i < m; i++) {
        for (int k = 0; k <= i; k++) {
            double sum = 0;
            for (int j = 0; j < n; j++)
                sum += f->W[i * n + j] * right[k * n + j];
            f->S[i * m + k] = sum;
        }
    }
    return cholesky(m, f->S);
}

static void solve_mass(const Factors *f, int n, double *b) {
    if (f->diagonal) {
        for (int j = 0; j < n; j++)
            b[j] *= f->L[j];
        return;
    }
    forward(n, f->L, b);
    backward(n, f->L, b);
}

int equations_solve(Equations *e, const double *b, const double *c, double *x, double *lambda) {
    const System *s = e->s;
    const Factors *f = e->factors;
    for (int k = 0; k < s->m; k++)
        lambda[k] = c[k];
    if (b != NULL) {
        for (int j = 0; j < s->nv; j++)
            x[j] = b[j];
        solve_mass(f, s->nv, x);
        rows_times(s, e->G, -1, x, lambda);
    }
    forward(s->m, f->S, lambda);
    backward(s->m, f->S, lambda);
    for (int j = 0; j < s->nv; j++)
        x[j] = b == NULL ? 0 : b[j];
    columns_times(s, e->G, 1, lambda, x);
    solve_mass(f, s->nv, x);
    return 0;
}

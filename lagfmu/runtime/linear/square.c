/* square.c -- as many rows as speeds: M x = b + G^T lambda, G x = c fall apart into
 *
 *   G x = c ,   G^T lambda = M x - b
 *
 * With rows and columns in the order of blocks G is lower triangular in blocks (Duff, Erisman & Reid, Direct Methods
 * for Sparse Matrices, ch. 6), which are the bodies and loops of a mechanism: each is factored by itself with partial
 * pivoting (Golub & Van Loan, Matrix Computations, sect. 3.4), and nothing fills in.
 *
 * Rows are scaled to unit norm in the metric of M's diagonal, columns by it, so that a pivot says how far a row stands out
 * whatever the units; below SQUARE_REGULAR the other rungs decide. */
#include "square.h"

#include <math.h>
#include <string.h>

static const double SQUARE_REGULAR = 1e-4;

/* The memory of a Linear for it. */
struct SquareMemory {
    int *row_block, *column_block, *row_at, *column_at; /* (nv) where each stands: block, and place in it */
    int *swap;                                          /* (nv) by place in all blocks: the row taken for it */
    int *begin;                                         /* (count + 1) of each block in: */
    double *lu;                                         /* all blocks, row by row, of the scaled values */
    double *row_scale, *column_scale, *right;           /* (nv) */
    int sign;
};

static int blocks_size(const Square *of) {
    int size = 0;
    for (int k = 0; k < of->count; k++) size += (of->start[k + 1] - of->start[k]) * (of->start[k + 1] - of->start[k]);
    return size;
}

static void find_places(const Square *of, struct SquareMemory *x) {
    x->begin[0] = 0;
    for (int k = 0; k < of->count; k++) {
        const int from = of->start[k], size = of->start[k + 1] - from;
        x->begin[k + 1] = x->begin[k] + size * size;
        for (int p = 0; p < size; p++) {
            x->row_block[of->rows[from + p]] = x->column_block[of->columns[from + p]] = k;
            x->row_at[of->rows[from + p]] = x->column_at[of->columns[from + p]] = p;
        }
    }
}

void square_layout(Linear *l, Arena *arena) {
    const Square *of = l->system->square;
    const int n = l->system->nv;
    struct SquareMemory counted, *x = arena_take(arena, 1, sizeof *x);
    l->square = x;
    if (x == NULL) x = &counted;
    x->row_block = arena_ints(arena, n);
    x->column_block = arena_ints(arena, n);
    x->row_at = arena_ints(arena, n);
    x->column_at = arena_ints(arena, n);
    x->swap = arena_ints(arena, n);
    x->begin = arena_ints(arena, of->count + 1);
    x->lu = arena_doubles(arena, blocks_size(of));
    x->row_scale = arena_doubles(arena, n);
    x->column_scale = arena_doubles(arena, n);
    x->right = arena_doubles(arena, n);
    if (x != &counted) find_places(of, x);
}

static void scale_by_masses(const Linear *l, struct SquareMemory *x) {
    const System *s = l->system;
    for (int j = 0; j < s->nv; j++) x->column_scale[j] = 1;
    for (int e = 0; e < s->masses; e++)
        if (s->mass_row[e] == s->mass_column[e] && l->M[e] > 0) x->column_scale[s->mass_row[e]] = 1 / sqrt(l->M[e]);
    for (int k = 0; k < s->m; k++) {
        double sum = 0;
        for (int e = s->row_start[k]; e < s->row_start[k + 1]; e++) {
            const double g = l->G[e] * x->column_scale[s->entry_column[e]];
            sum += g * g;
        }
        x->row_scale[k] = sum > 0 ? 1 / sqrt(sum) : 1;
    }
}

static void scatter(const Linear *l, struct SquareMemory *x) {
    const System *s = l->system;
    const int *start = s->square->start;
    memset(x->lu, 0, (size_t)x->begin[s->square->count] * sizeof *x->lu);
    for (int e = 0; e < s->entries; e++) {
        const int r = s->entry_row[e], c = s->entry_column[e], k = x->row_block[r];
        if (x->column_block[c] == k)
            x->lu[x->begin[k] + x->row_at[r] * (start[k + 1] - start[k]) + x->column_at[c]] =
                l->G[e] * x->row_scale[r] * x->column_scale[c];
    }
}

/* L U of one block in place; the smallest pivot, with the sign of the determinant in `sign`. */
static double factor_block(double *a, int n, int *swap, int *sign) {
    double least = HUGE_VAL;
    for (int k = 0; k < n; k++) {
        int taken = k;
        for (int i = k + 1; i < n; i++)
            if (fabs(a[i * n + k]) > fabs(a[taken * n + k])) taken = i;
        swap[k] = taken;
        if (taken != k) {
            *sign = -*sign;
            for (int j = 0; j < n; j++) {
                const double held = a[k * n + j];
                a[k * n + j] = a[taken * n + j];
                a[taken * n + j] = held;
            }
        }
        const double pivot = a[k * n + k];
        if (!(fabs(pivot) > 0)) return 0;
        if (pivot < 0) *sign = -*sign;
        least = fmin(least, fabs(pivot));
        for (int i = k + 1; i < n; i++) {
            if (a[i * n + k] == 0) continue;
            const double part = a[i * n + k] /= pivot;
            for (int j = k + 1; j < n; j++) a[i * n + j] -= part * a[k * n + j];
        }
    }
    return least;
}

int square_factor(Linear *l) {
    const Square *of = l->system->square;
    struct SquareMemory *x = l->square;
    double least = HUGE_VAL;
    scale_by_masses(l, x);
    scatter(l, x);
    x->sign = 1;
    for (int k = 0; k < of->count && least > 0; k++)
        least = fmin(least, factor_block(x->lu + x->begin[k], of->start[k + 1] - of->start[k], x->swap + of->start[k], &x->sign));
    if (!(least > 0)) x->sign = 0;
    return least >= SQUARE_REGULAR;
}

int square_sign(Linear *l) {
    if (l->rung != RUNG_SQUARE) (void)square_factor(l);
    return l->square->sign;
}

/* The block's part of G x = c: y (n), scaled. */
static void solve_block(const double *a, int n, const int *swap, double *y) {
    for (int k = 0; k < n; k++) {
        const double held = y[swap[k]];
        y[swap[k]] = y[k];
        y[k] = held;
    }
    for (int i = 0; i < n; i++)
        for (int j = 0; j < i; j++) y[i] -= a[i * n + j] * y[j];
    for (int i = n - 1; i >= 0; i--) {
        for (int j = i + 1; j < n; j++) y[i] -= a[i * n + j] * y[j];
        y[i] /= a[i * n + i];
    }
}

/* The same of G^T. */
static void solve_block_transposed(const double *a, int n, const int *swap, double *y) {
    for (int i = 0; i < n; i++) {
        y[i] /= a[i * n + i];
        for (int j = i + 1; j < n; j++) y[j] -= a[i * n + j] * y[i];
    }
    for (int i = n - 1; i >= 0; i--)
        for (int j = 0; j < i; j++) y[j] -= a[i * n + j] * y[i];
    for (int k = n - 1; k >= 0; k--) {
        const double held = y[swap[k]];
        y[swap[k]] = y[k];
        y[k] = held;
    }
}

/* x from c, block by block downwards. */
static void find_x(const Linear *l, const double *c, double *x) {
    const System *s = l->system;
    const Square *of = s->square;
    const struct SquareMemory *own = l->square;
    double *y = own->right;
    for (int k = 0; k < of->count; k++) {
        const int from = of->start[k], size = of->start[k + 1] - from;
        for (int p = 0; p < size; p++) {
            const int r = of->rows[from + p];
            double sum = c[r];
            for (int e = s->row_start[r]; e < s->row_start[r + 1]; e++)
                if (own->column_block[s->entry_column[e]] != k) sum -= l->G[e] * x[s->entry_column[e]];
            y[p] = sum * own->row_scale[r];
        }
        solve_block(own->lu + own->begin[k], size, own->swap + from, y);
        for (int p = 0; p < size; p++) x[of->columns[from + p]] = y[p] * own->column_scale[of->columns[from + p]];
    }
}

/* lambda from M x - b, block by block upwards. */
static void find_lambda(const Linear *l, const double *b, const double *x, double *lambda) {
    const System *s = l->system;
    const Square *of = s->square;
    const struct SquareMemory *own = l->square;
    double *left = l->refinement.r, *y = own->right;
    for (int j = 0; j < s->nv; j++) left[j] = b != NULL ? -b[j] : 0;
    for (int e = 0; e < s->masses; e++) {
        const int i = s->mass_row[e], j = s->mass_column[e];
        left[i] += l->M[e] * x[j];
        if (i != j) left[j] += l->M[e] * x[i];
    }
    for (int k = of->count - 1; k >= 0; k--) {
        const int from = of->start[k], size = of->start[k + 1] - from;
        for (int p = 0; p < size; p++) y[p] = left[of->columns[from + p]] * own->column_scale[of->columns[from + p]];
        solve_block_transposed(own->lu + own->begin[k], size, own->swap + from, y);
        for (int p = 0; p < size; p++) {
            const int r = of->rows[from + p];
            lambda[r] = y[p] * own->row_scale[r];
            for (int e = s->row_start[r]; e < s->row_start[r + 1]; e++)
                left[s->entry_column[e]] -= l->G[e] * lambda[r];
        }
    }
}

void square_solve(Linear *l, const double *b, const double *c, double *x, double *lambda) {
    find_x(l, c, x);
    if (lambda != NULL) find_lambda(l, b, x, lambda);
}

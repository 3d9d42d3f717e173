/* stiffened.c -- a singular mass matrix made definite by constraints that hold it:
 *
 *   (M + G_s^T Sigma G_s) x = b + G_s^T Sigma c_s + G^T lambda ,  G x = c
 *
 * has the x and lambda of M x = b + G^T lambda, G x = c, since G_s x = c_s (augmented Lagrangian: Golub &
 * Greif, SIAM J. Sci. Comput. 24 (2003) 2076).  Rows s are those whose coordinates M couples each with each,
 * such as the unit length of Euler parameters, whose M is singular along p: then nothing is added to the
 * pattern of M, and the sparse elimination stays as it is.  sigma_k = sum_j M_jj / sum_j G_kj^2 makes both
 * parts alike.  lambda is then the difference of sigma c and what that moves: a needle that spins about its
 * own axis has far smaller forces than its other inertia times its acceleration, and lost their digits. */
#include "stiffened.h"

#include <math.h>

#include "schur.h"

static const double BURIED = 100; /* sigma c beside the forces, from which on these have lost two digits */

/* Where M_ij stands among its values, i >= j; -1: nowhere.  They are sorted by (row, column). */
static int place(const System *s, int i, int j) {
    int low = 0, high = s->masses;
    if (i < j) return place(s, j, i);
    while (low < high) {
        const int middle = (low + high) / 2, row = s->mass_row[middle];
        if (row < i || (row == i && s->mass_column[middle] < j))
            low = middle + 1;
        else
            high = middle;
    }
    return low < s->masses && s->mass_row[low] == i && s->mass_column[low] == j ? low : -1;
}

static int is_coupled(const System *s, int k) {
    const int begin = s->row_start[k], end = s->row_start[k + 1];
    for (int a = begin; a < end; a++)
        for (int e = begin; e <= a; e++)
            if (place(s, s->entry_column[a], s->entry_column[e]) < 0) return 0;
    return end > begin;
}

void stiffened_layout(Linear *l, Arena *arena) {
    const System *s = l->system;
    l->masses = arena_doubles(arena, s->masses);
    l->forces = arena_doubles(arena, s->nv);
    l->sigma = arena_doubles(arena, s->m);
    l->holds = arena_ints(arena, s->m);
    l->stiffened = 0;
    if (arena->base == NULL) return;
    for (int k = 0; k < s->m; k++) l->holds[k] = is_coupled(s, k);
}

/* 0 where the row is zero. */
static double stiffness(const Linear *l, int k) {
    const System *s = l->system;
    double mass = 0, square = 0;
    for (int a = s->row_start[k]; a < s->row_start[k + 1]; a++) {
        const int j = s->entry_column[a];
        mass += l->M[place(s, j, j)];
        square += l->G[a] * l->G[a];
    }
    return mass > 0 && square > 0 ? mass / square : 0;
}

int stiffened_masses(Linear *l) {
    const System *s = l->system;
    int any = 0;
    for (int k = 0; k < s->m; k++) {
        l->sigma[k] = l->holds[k] && l->active[k] ? stiffness(l, k) : 0;
        any |= l->sigma[k] > 0;
    }
    if (!any) return 0;
    for (int e = 0; e < s->masses; e++) l->masses[e] = l->M[e];
    for (int k = 0; k < s->m; k++) {
        if (!(l->sigma[k] > 0)) continue;
        for (int a = s->row_start[k]; a < s->row_start[k + 1]; a++)
            for (int e = s->row_start[k]; e <= a; e++)
                l->masses[place(s, s->entry_column[a], s->entry_column[e])] +=
                    l->sigma[k] * l->G[a] * l->G[e];
    }
    l->bare = l->M;
    l->M = l->masses;
    l->stiffened = 1;
    return 1;
}

const double *stiffened_forces(const Linear *l, const double *b, const double *c) {
    const System *s = l->system;
    for (int j = 0; j < s->nv; j++) l->forces[j] = b != NULL ? b[j] : 0;
    for (int k = 0; k < s->m; k++)
        if (l->sigma[k] > 0)
            for (int a = s->row_start[k]; a < s->row_start[k + 1]; a++)
                l->forces[s->entry_column[a]] += l->sigma[k] * l->G[a] * c[k];
    return l->forces;
}

/* The largest force on a coordinate of row k, from outside or of a constraint. */
static double pushed(const Linear *l, int k, const double *b, const double *lambda) {
    const System *s = l->system;
    double largest = 0;
    for (int a = s->row_start[k]; a < s->row_start[k + 1]; a++) {
        const int j = s->entry_column[a];
        largest = fmax(largest, fabs(b[j]));
        for (int e = 0; e < s->entries; e++)
            if (s->entry_column[e] == j && l->active[s->entry_row[e]])
                largest = fmax(largest, fabs(l->G[e] * lambda[s->entry_row[e]]));
    }
    return largest;
}

int stiffened_tells(const Linear *l, const double *b, const double *c, const double *lambda) {
    const System *s = l->system;
    for (int k = 0; k < s->m; k++) {
        const double held = l->sigma[k] * fabs(c[k]) / BURIED;
        double lever = 0;
        if (held <= fabs(lambda[k])) continue;
        for (int a = s->row_start[k]; a < s->row_start[k + 1]; a++)
            lever = fmax(lever, fabs(l->G[a]));
        if (held * lever > pushed(l, k, b, lambda)) return 0;
    }
    return 1;
}

void stiffened_undo(Linear *l) {
    l->M = l->bare;
    l->stiffened = 0;
    schur_of(l)->definite = 0;
}

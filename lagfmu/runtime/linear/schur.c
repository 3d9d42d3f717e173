/* schur.c -- accelerations and multipliers by the Schur complement (Ascher & Petzold, Computer
 * Methods for Ordinary Differential Equations and Differential-Algebraic Equations, sect. 10.2):
 *
 *   S lambda = c - G M^-1 b ,   S = G M^-1 G^T ,   x = M^-1 (b + G^T lambda)
 *
 * in the fixed pattern of the plan, P M P^T = L D L^T, W = L^-1 P G^T, S = W^T D^-1 W = L' D' L'^T.
 * A row that does not act keeps its place with S_kk = 1 alone, and is passed over: its lambda is 0.
 *
 * S squares the ratio of masses, so it is guarded by the bound of ldlt.c on the condition number of
 * M and of S scaled to unit diagonals, which is never below it.  lambda was measured to lose 1e-16
 * times that bound on chains with masses of any ratio.  Where that is more than 1e-12 it is refined
 * by what it leaves of both equations (Higham, Accuracy and Stability of Numerical Algorithms,
 * sect. 12.1), and taken only if a correction is seen to be so small that the next would be below
 * rounding. */
#include "schur.h"

#include <float.h>
#include <math.h>

#include "numbers.h"
#include "refinement.h"

static const double EXACT = 4e3;    /* condition up to which lambda is right to 1e-12 as it is */
static const double LITTLE = 1e3;  /* cancellation in pivots that does not count: see judge() */
static const double PLAIN = 1e6;    /* up to which residuals in working precision will do */
static const double DOUBLED = 1e10; /* up to which refinement is tried if KKT is at hand; beyond, a bound that
                                     * costs more is asked */
static const double PIVOT = 1e-8;   /* smallest pivot of M relative to its diagonal */
static const double SETTLED = 1e-9; /* a correction so small is followed by one below rounding */

void schur_layout(Linear *l, Arena *arena) {
    const System *s = l->system;
    const Plan *plan = s->plan;
    Schur *own = arena_take(arena, 1, sizeof(Schur));
    int entries = plan->diagonal ? s->entries : plan->w_start[plan->massless ? 0 : s->m];
    int full = s->nv > s->m ? s->nv : s->m;
    Schur at = {0};
    at.mass_lower = arena_doubles(arena, plan->mass.start[plan->mass.size]);
    at.inverse_mass = arena_doubles(arena, s->nv);
    at.w_own = arena_doubles(arena, plan->diagonal ? 0 : entries);
    at.w_start = plan->diagonal ? s->row_start : plan->w_start;
    at.w_column = plan->diagonal ? s->entry_column : plan->w_column;
    at.h = arena_doubles(arena, entries);
    at.lower = arena_doubles(arena, plan->schur.start[plan->schur.size]);
    at.inverse = arena_doubles(arena, s->m);
    at.diagonal = arena_doubles(arena, s->m);
    at.bounds.size = arena_doubles(arena, full);
    at.bounds.scale = arena_doubles(arena, full);
    at.bounds.norm = arena_doubles(arena, full);
    at.bounds.row = arena_doubles(arena, full);
    at.reverse = arena_doubles(arena, plan->schur.forest ? 0 : plan->schur.start[plan->schur.size]);
    at.mass_begin = arena_ints(arena, plan->mass.start[plan->mass.size]);
    at.begin = arena_ints(arena, plan->schur.start[plan->schur.size]);
    at.y = arena_doubles(arena, s->nv);
    at.z = arena_doubles(arena, s->m);
    at.lambda = arena_doubles(arena, s->m);
    at.trust = SCHUR_UNSAFE;
    if (arena->base == NULL) return;
    for (int i = 0; i < full; i++) at.bounds.row[i] = 0;
    ldlt_begins(&plan->mass, at.mass_begin);
    ldlt_begins(&plan->schur, at.begin);
    *own = at;
    l->sparse = (double *)(void *)own;
}

/* 1 / M_ii; 0 unless all are positive and finite. */
static int invert_diagonal(Schur *own, const double *M, int n) {
    int good = 1;
    for (int i = 0; i < n; i++) {
        good &= (M[i] > 0) & (M[i] <= DBL_MAX);
        own->inverse_mass[i] = 1 / M[i];
    }
    for (int i = 0; i < n && !good; i++)
        if (!(M[i] > 0)) own->doubtful_mass = i;
    return good;
}

/* P M P^T = L D L^T; 0 unless its pivots are safely positive. */
static int factor_masses(const Plan *plan, Schur *own, const double *M) {
    const Elimination *e = &plan->mass;
    for (int p = 0; p < e->size; p++) own->inverse_mass[p] = M[plan->mass_diagonal[p]];
    for (int k = 0; k < e->start[e->size]; k++)
        own->mass_lower[k] = plan->mass_value[k] < 0 ? 0 : M[plan->mass_value[k]];
    Definite found = ldlt_factor(e, own->mass_begin, own->mass_lower, own->inverse_mass, &own->bounds, NULL);
    own->condition = found.bound;
    own->growth = found.growth;
    if (found.failed >= 0) own->doubtful_mass = e->order[found.failed];
    return found.bound < HUGE_VAL && found.growth < 1 / PIVOT;
}

/* Row k of W by L w = P g_k, forward through its non-zeros alone. */
static void eliminate_row(const Plan *plan, Schur *own, const double *G, int k) {
    const Elimination *e = &plan->mass;
    const int from = plan->w_start[k], to = plan->w_start[k + 1];
    double *w = own->bounds.row;
    for (int a = from; a < to; a++) {
        const int p = plan->w_column[a], value = plan->w_value[a];
        double sum = value < 0 ? 0 : G[value];
        for (int r = e->start[p]; r < e->start[p + 1]; r++)
            sum -= own->mass_lower[r] * w[e->column[r]];
        w[p] = own->w_own[a] = sum;
    }
    for (int a = from; a < to; a++) w[plan->w_column[a]] = 0;
}

/* D^-1 W and S_kk of row k. */
static double scale_row(const Schur *own, int k) {
    double *h = own->h, sum = 0;
    for (int a = own->w_start[k], to = own->w_start[k + 1]; a < to; a++) {
        const double w = own->w[a];
        h[a] = w * own->inverse_mass[own->w_column[a]];
        sum += w * h[a];
    }
    return sum;
}

int schur_masses(Linear *l, int zero_rows) {
    const System *s = l->system;
    const Plan *plan = s->plan;
    Schur *own = schur_of(l);
    own->condition = own->growth = 1;
    own->doubtful_mass = own->doubtful_row = -1;
    own->definite = 0;
    if (plan->massless) return 0;
    if (!(plan->diagonal ? invert_diagonal(own, l->M, s->nv) : factor_masses(plan, own, l->M)))
        return 0;
    own->definite = 1;
    own->w = plan->diagonal ? l->G : own->w_own;
    for (int k = 0; k < s->m; k++) {
        own->diagonal[k] = 1;
        if (!l->active[k]) continue;
        if (!plan->diagonal) eliminate_row(plan, own, l->G, k);
        own->diagonal[k] = scale_row(own, k);
        if (own->diagonal[k] > 0 && own->diagonal[k] <= DBL_MAX) continue;
        own->doubtful_row = k;
        if (!(own->diagonal[k] == 0 && zero_rows)) return 0;
    }
    return 1;
}

/* S below the diagonal, and its diagonal, in the order of elimination. */
static void assemble(const Plan *plan, Schur *own, const int *acts) {
    const Elimination *e = &plan->schur;
    const int *left = plan->pair_a, *right = plan->pair_b;
    const double *w = own->w, *h = own->h;
    for (int p = 0; p < e->size; p++) {
        const int there = acts == NULL || acts[e->order[p]];
        own->inverse[p] = there ? own->diagonal[e->order[p]] : 1;
        for (int k = e->start[p]; k < e->start[p + 1]; k++) {
            double sum = 0;
            if (there && (acts == NULL || acts[e->order[e->column[k]]]))
                for (int a = plan->pair_start[k], to = plan->pair_start[k + 1]; a < to; a++)
                    sum += w[left[a]] * h[right[a]];
            own->lower[k] = sum;
        }
    }
}

/* S is worse conditioned than the equations themselves where light masses make its pivots cancel,
 * and there digits must be won back.  Where they hardly do, a large condition number is the
 * equations' own, as in a long chain. */
static Trust judge(const Linear *l, double bound, double growth) {
    if (bound <= (growth <= LITTLE ? PLAIN : EXACT)) return SCHUR_EXACT;
    if (bound <= PLAIN) return SCHUR_REFINED;
    if (bound <= DOUBLED) return SCHUR_DOUBLED;
    return l->dense == NULL && bound < HUGE_VAL ? SCHUR_DOUBLED : SCHUR_UNSAFE;
}

/* Whether a bound that costs more may tell that S can be trusted as it is, or at all. */
static int matters(double bound, double growth) { return bound > (growth <= LITTLE ? PLAIN : DOUBLED); }

/* The condition of S by the trace of its inverse, which is never below it either. */
static double traced(const Linear *l, double norm) {
    const Schur *own = schur_of(l);
    const Elimination *e = &l->system->plan->schur;
    const Reverse scratch = {own->reverse, own->z, own->bounds.size, own->bounds.row};
    return norm * ldlt_trace(e, own->begin, own->lower, own->inverse, own->diagonal, l->some, &scratch);
}

int schur_factor(Linear *l) {
    const Plan *plan = l->system->plan;
    Schur *own = schur_of(l);
    own->trust = SCHUR_UNSAFE;
    own->apart = 1;
    if (!schur_masses(l, 0)) return 0;
    if (l->system->m > 0) {
        assemble(plan, own, l->some);
        Definite found = ldlt_factor(&plan->schur, own->begin, own->lower, own->inverse, &own->bounds, l->some);
        if (found.failed >= 0) own->doubtful_row = plan->schur.order[found.failed];
        own->growth = larger(own->growth, found.growth);
        if (found.failed < 0 && !plan->schur.forest && matters(found.bound, own->growth))
            found.bound = larger(traced(l, found.norm), found.growth);
        own->condition = larger(own->condition, found.bound);
        own->apart = found.failed < 0 ? 1 / sqrt(found.growth) : 0;
    }
    own->trust = judge(l, own->condition, own->growth);
    return own->trust != SCHUR_UNSAFE;
}

void schur_half(const Linear *l, const double *b, double *y) {
    const System *s = l->system;
    const Schur *own = schur_of(l);
    if (s->plan->diagonal) {
        for (int i = 0; i < s->nv; i++) y[i] = b[i] * own->inverse_mass[i];
        return;
    }
    const Elimination *e = &s->plan->mass;
    for (int p = 0; p < s->nv; p++) y[p] = b[e->order[p]];
    ldlt_forward(e, own->mass_lower, y);
    for (int p = 0; p < s->nv; p++) y[p] *= own->inverse_mass[p];
}

void schur_back(const Linear *l, double *y, double *x) {
    const Elimination *e = &l->system->plan->mass;
    if (l->system->plan->diagonal) {
        for (int i = 0; i < l->system->nv; i++) x[i] = y[i];
        return;
    }
    ldlt_backward(e, schur_of(l)->mass_lower, y);
    for (int p = 0; p < e->size; p++) x[e->order[p]] = y[p];
}

/* y <- y + D^-1 W lambda with W^T y = c (NULL: 0) on the rows that act. */
static void constrain(const Linear *l, const double *c, double *y, double *lambda) {
    const Schur *own = schur_of(l);
    const Elimination *e = &l->system->plan->schur;
    const int *start = own->w_start, *column = own->w_column;
    double *z = own->z;
    for (int p = 0; p < e->size; p++) { /* L' z = c - W^T y */
        int k = e->order[p];
        z[p] = 0;
        if (!l->active[k]) continue;
        double sum = c != NULL ? c[k] : 0;
        for (int a = start[k], to = start[k + 1]; a < to; a++) sum -= own->w[a] * y[column[a]];
        for (int a = e->start[p], to = e->start[p + 1]; a < to; a++) sum -= own->lower[a] * z[e->column[a]];
        z[p] = sum;
    }
    for (int p = 0; p < e->size; p++) z[p] *= own->inverse[p];
    for (int p = e->size - 1; p >= 0; p--) { /* L'^T lambda = D'^-1 z */
        int k = e->order[p];
        lambda[k] = 0;
        if (l->some != NULL && !l->some[k]) continue;
        const double known = lambda[k] = z[p];
        for (int a = e->start[p], to = e->start[p + 1]; a < to; a++) z[e->column[a]] -= own->lower[a] * known;
        for (int a = start[k], to = start[k + 1]; a < to; a++) y[column[a]] += own->h[a] * known;
    }
}

void schur_begin_row(const Linear *l, int k, double *y) {
    const Schur *own = schur_of(l);
    for (int i = 0; i < l->system->nv; i++) y[i] = 0;
    for (int a = own->w_start[k]; a < own->w_start[k + 1]; a++) y[own->w_column[a]] = own->h[a];
}

void schur_express(Linear *l, double *y, double *lambda) {
    const int *active = l->active;
    l->active = l->some;
    constrain(l, NULL, y, lambda);
    l->active = active;
}

static void substitute_schur(Linear *l, const double *b, const double *c, double *x, double *lambda) {
    int diagonal = l->system->plan->diagonal;
    double *y = diagonal ? x : schur_of(l)->y;
    if (b != NULL) {
        schur_half(l, b, y);
    } else {
        for (int i = 0; i < l->system->nv; i++) y[i] = 0;
    }
    constrain(l, c, y, lambda);
    if (!diagonal) schur_back(l, y, x);
}

/* Whether the corrections are small: of x in the norm of M's diagonal, of lambda in the norm of
 * S's. */
static int settled(const Linear *l, const double *x, const double *lambda) {
    const System *s = l->system;
    const double *diagonal = schur_of(l)->diagonal;
    const Refinement *own = &l->refinement;
    double moved = 0, size = 0, moved_lambda = 0, size_lambda = 0;
    for (int a = 0; a < s->masses; a++) {
        int i = s->mass_row[a];
        if (i != s->mass_column[a]) continue;
        moved += l->M[a] * own->dx[i] * own->dx[i];
        size += l->M[a] * x[i] * x[i];
    }
    for (int k = 0; k < s->m; k++) {
        moved_lambda += diagonal[k] * own->dlambda[k] * own->dlambda[k];
        size_lambda += diagonal[k] * lambda[k] * lambda[k];
    }
    double all = size + size_lambda;
    return moved <= SETTLED * SETTLED * all && moved_lambda <= SETTLED * SETTLED * all;
}

int schur_solve(Linear *l, const double *b, const double *c, double *x, double *lambda) {
    const Trust trust = schur_of(l)->trust;
    substitute_schur(l, b, c, x, lambda);
    if (trust == SCHUR_EXACT) return 1;
    refine_begin(l);
    for (int step = 0; step < 3; step++) {
        refine_once(l, substitute_schur, trust == SCHUR_DOUBLED, b, c, x, lambda);
        if (settled(l, x, lambda)) return 1;
    }
    return 0;
}

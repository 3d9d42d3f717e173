/* nonunique.c -- redundant sticking: which of the multipliers that hold the same motion lies within the cones.
 *
 * Where rows depend on each other lambda is one of lambda + Z^T y, with Z G = 0.  Normal forces are those of the
 * lambda of least norm, sticking or slipping: by a strain of its own a body could hold whatever one likes.
 * With N as it is a friction sticks as long as *some* y has |lambda_t| <= mu N in every cone.  The least
 * reserve over all cones, min (mu N - |lambda_t|), is concave in y: its maximum is found by the ellipsoid
 * method (Shor 1977; Boyd & Vandenberghe 2008), for one y by bisection.  What is reported is the lambda of
 * least norm if that is within the cones, else the nearest on the way to the maximum. */
#include <float.h>
#include <string.h>

#include "friction.h"
#include "numbers.h"

static const double NONUNIQUE_DEPENDENT = 1e-9; /* of a row's norm, left over by the others: nothing */
static const double NONUNIQUE_WIDE = 1e2;       /* times the forces at work: how far is looked */
enum { NONUNIQUE_ROUNDS = 60 };                 /* bisections, and ellipsoids for each pair of unknowns */

size_t nonunique_doubles(const System *s) {
    const size_t m = (size_t)s->m, n = (size_t)s->nv;
    return m * n + 2 * m * m + 3 * m + n + m * m + 5 * m; /* basis, made, Z, there, y, best, P, ... */
}

typedef struct {
    Mechanism *b;
    int count;            /* dependent rows */
    double *Z;            /* (count, m) */
    double *there;        /* (m) lambda + Z^T y */
    double *y, *best;     /* (count) */
    double *slope, *g, *Pg; /* (count) */
    double *P;            /* (count, count) */
} Nonunique;

static void orthonormalize(Nonunique *x) {
    const int m = x->b->system->m;
    for (int i = 0; i < x->count; i++) {
        double *z = x->Z + i * m;
        for (int j = 0; j < i; j++) add_part(m, -dot(m, x->Z + j * m, z), x->Z + j * m, z);
        const double norm = sqrt(dot(m, z, z));
        for (int k = 0; k < m; k++) z[k] /= norm;
    }
}

/* Z: each row that acts eliminated by those before it, twice (Kahan). */
static void find_null_space(Nonunique *x, double *basis, double *made, double *rest) {
    const Mechanism *b = x->b;
    const System *s = b->system;
    const int n = s->nv, m = s->m;
    int kept = 0;
    x->count = 0;
    for (int k = 0; k < m; k++) {
        if (!b->friction->acting[k]) continue;
        double *of = x->Z + x->count * m;
        memset(rest, 0, (size_t)n * sizeof *rest);
        memset(of, 0, (size_t)m * sizeof *of);
        of[k] = 1;
        for (int e = s->row_start[k]; e < s->row_start[k + 1]; e++)
            rest[s->entry_column[e]] = b->G[e];
        const double norm = sqrt(dot(n, rest, rest));
        for (int round = 0; round < 2; round++)
            for (int i = 0; i < kept; i++) {
                const double part = dot(n, basis + i * n, rest);
                add_part(n, -part, basis + i * n, rest);
                add_part(m, -part, made + i * m, of);
            }
        const double left = sqrt(dot(n, rest, rest));
        if (!(left > NONUNIQUE_DEPENDENT * norm)) {
            x->count += 1;
            continue;
        }
        for (int j = 0; j < n; j++) basis[kept * n + j] = rest[j] / left;
        for (int i = 0; i < m; i++) made[kept * m + i] = of[i] / left;
        kept += 1;
    }
    orthonormalize(x);
}

/* By how much component p of a normal force grows along z, relative to its coefficients. */
static double normal_along(const Mechanism *b, int p, const double *z) {
    const NormalPart *part = &b->system->normal_part[p];
    double sum = 0, most = 0;
    for (int k = part->first; k < part->first + part->normals; k++) {
        sum += b->friction->part_c[k] * z[b->system->normal_row[k]];
        most = fmax(most, fabs(b->friction->part_c[k]));
    }
    return most > 0 ? sum / most : 0;
}

/* Of Z what leaves component p of a normal force as it is. */
static void keep_normal(Nonunique *x, int p) {
    const int m = x->b->system->m;
    int pivot = 0;
    for (int j = 0; j < x->count; j++) {
        x->slope[j] = normal_along(x->b, p, x->Z + j * m);
        if (fabs(x->slope[j]) > fabs(x->slope[pivot])) pivot = j;
    }
    if (x->count == 0 || !(fabs(x->slope[pivot]) > NONUNIQUE_DEPENDENT)) return;
    for (int j = 0; j < x->count; j++)
        if (j != pivot) add_part(m, -x->slope[j] / x->slope[pivot], x->Z + pivot * m, x->Z + j * m);
    x->count -= 1;
    memcpy(x->Z + pivot * m, x->Z + x->count * m, (size_t)m * sizeof *x->Z);
    orthonormalize(x);
}

/* The least reserve at part * y [N]; its slope in y. */
static double worst_cone(Nonunique *x, double part, const double *y) {
    const Mechanism *b = x->b;
    const System *s = b->system;
    const struct FrictionForces *f = b->friction;
    const int m = s->m;
    double least = HUGE_VAL;
    memcpy(x->there, b->lambda, (size_t)m * sizeof *x->there);
    for (int i = 0; i < x->count; i++) add_part(m, part * y[i], x->Z + i * m, x->there);
    for (int i = 0; i < s->frictions; i++) {
        const Friction *law = &s->friction[i];
        if (!f->loaded[i] || !f->stick_slip[i].sticks) continue;
        double force = 0;
        for (int r = 0; r < law->rows; r++) force = hypot(force, x->there[law->row[r]]);
        const double value = f->mu[2 * i] * friction_norms(b, i, 1, b->lambda) - force;
        if (!(value < least)) continue;
        least = value;
        for (int j = 0; j < x->count; j++) {
            const double *z = x->Z + j * m;
            double slope = 0;
            for (int r = 0; r < law->rows && force > 0; r++)
                slope -= z[law->row[r]] * x->there[law->row[r]] / force;
            x->slope[j] = slope;
        }
    }
    return least;
}

static void note_best(Nonunique *x, double value, double *top) {
    if (!(value > *top)) return;
    *top = value;
    memcpy(x->best, x->y, (size_t)x->count * sizeof *x->y);
}

static void bisect(Nonunique *x, double wide) {
    double low = -wide, high = wide, zero = 0, top = worst_cone(x, 0, &zero);
    x->best[0] = 0;
    for (int round = 0; round < 2 * NONUNIQUE_ROUNDS; round++) {
        x->y[0] = (low + high) / 2;
        note_best(x, worst_cone(x, 1, x->y), &top);
        if (x->slope[0] > 0)
            low = x->y[0];
        else
            high = x->y[0];
    }
}

static void shrink_ellipsoid(Nonunique *x, double wide) {
    const int count = x->count;
    const double n = count;
    double top = -HUGE_VAL;
    memset(x->y, 0, (size_t)count * sizeof *x->y);
    memset(x->best, 0, (size_t)count * sizeof *x->best);
    for (int i = 0; i < count * count; i++) x->P[i] = 0;
    for (int i = 0; i < count; i++) x->P[i * count + i] = wide * wide;
    for (int round = 0; round < NONUNIQUE_ROUNDS * count * count; round++) {
        note_best(x, worst_cone(x, 1, x->y), &top);
        for (int i = 0; i < count; i++) x->Pg[i] = dot(count, x->P + i * count, x->slope);
        const double size = dot(count, x->slope, x->Pg);
        if (!(size > 0)) return;
        for (int i = 0; i < count; i++) x->g[i] = x->Pg[i] / sqrt(size);
        add_part(count, 1 / (n + 1), x->g, x->y);
        for (int i = 0; i < count; i++)
            for (int j = 0; j <= i; j++) /* symmetric to the bit: what is not grows with each round */
                x->P[j * count + i] = x->P[i * count + j] =
                    n * n / (n * n - 1) * (x->P[i * count + j] - 2 / (n + 1) * x->g[i] * x->g[j]);
    }
}

/* With the null space of the rows that act. */
static Nonunique nonunique_of(Mechanism *b) {
    const System *s = b->system;
    const int n = s->nv, m = s->m;
    double *place = b->friction->nonunique, *basis = place, *made = basis + m * n;
    Nonunique x = {b, 0, made + m * m, NULL, NULL, NULL, NULL, NULL, NULL, NULL};
    double *rest = x.Z + m * m;
    x.there = rest + n;
    x.y = x.there + m;
    x.best = x.y + m;
    x.slope = x.best + m;
    x.g = x.slope + m;
    x.Pg = x.g + m;
    x.P = x.Pg + m;
    find_null_space(&x, basis, made, rest);
    return x;
}

int normal_is_unique(Mechanism *b, int i) {
    const Nonunique x = nonunique_of(b);
    const Friction *law = &b->system->friction[i];
    for (int p = law->part; p < law->part + law->parts; p++)
        for (int j = 0; j < x.count; j++)
            if (fabs(normal_along(b, p, x.Z + j * b->system->m)) > NONUNIQUE_DEPENDENT) return 0;
    return 1;
}

int friction_is_unique(Mechanism *b, int i) {
    const Nonunique x = nonunique_of(b);
    const Friction *law = &b->system->friction[i];
    for (int r = 0; r < law->rows; r++)
        for (int j = 0; j < x.count; j++)
            if (fabs(x.Z[j * b->system->m + law->row[r]]) > NONUNIQUE_DEPENDENT) return 0;
    return 1;
}

void nonunique_best(Mechanism *b, double *best) {
    const System *s = b->system;
    const int m = s->m;
    Nonunique x = nonunique_of(b);
    memcpy(best, b->lambda, (size_t)m * sizeof *best);
    for (int i = 0; i < s->frictions; i++) {
        const Friction *law = &s->friction[i];
        for (int p = law->part; p < law->part + law->parts && b->friction->loaded[i]; p++) keep_normal(&x, p);
    }
    if (x.count == 0) return;
    double wide = 0, low = 0, high = 1;
    for (int k = 0; k < m; k++) wide = fmax(wide, fabs(b->lambda[k]));
    for (int i = 0; i < s->frictions; i++) wide = fmax(wide, fabs(b->friction->load[i]));
    if (x.count == 1)
        bisect(&x, NONUNIQUE_WIDE * wide);
    else
        shrink_ellipsoid(&x, NONUNIQUE_WIDE * wide);
    if (worst_cone(&x, 0, x.best) < 0) {
        for (int round = 0; round < NONUNIQUE_ROUNDS; round++) {
            const double middle = (low + high) / 2;
            if (worst_cone(&x, middle, x.best) < 0)
                low = middle;
            else
                high = middle;
        }
        low = high;
    }
    (void)worst_cone(&x, 1, x.best);
    memcpy(best, x.there, (size_t)m * sizeof *best);
    (void)worst_cone(&x, low, x.best);
    memcpy(b->lambda, x.there, (size_t)m * sizeof *best);
}

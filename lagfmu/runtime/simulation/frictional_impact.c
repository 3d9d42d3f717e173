/* frictional_impact.c -- impacts with friction: Coulomb's cone on the impulses of contacts that are struck.
 *
 *   0 <= Lambda_n  _|_  s_n+ + e s_n- >= 0 ,   |Lambda_t| <= mu_k N ,  N = sum c Lambda_n ,
 *   Lambda_t = -mu_k N s_t+/|s_t+|  where s_t+ is not 0
 *
 * Moreau's law (Moreau 1988; Glocker, Set-Valued Force Laws, 2001), solved by projected sweeps over the rows
 * (Jourdan, Alart & Jean 1998).  Without rebound (e = 0) it never raises the energy; Newton's rebound with
 * friction can (Kane & Levinson 1985).  Between the two, both within the convex cones, the impact is taken
 * that keeps it. */
#include <math.h>
#include <string.h>

#include "friction.h"
#include "friction_events.h"
#include "stick_slip.h"

enum { FRICTIONAL_SWEEPS = 20000 };
static const double FRICTIONAL_CLOSE = 1e-15; /* of the largest impulse: what a sweep may still change */
static const double FRICTIONAL_ROUGH = 1e-9;  /* beyond which the sweeps have not arrived */

/* The contacts' rows, then those of the frictions whose normal force is theirs. */
typedef struct {
    Solver *s;
    Mechanism *b;
    int *rows, count, contacts; /* rows, of which the first are contacts */
    int *loaded;                /* (frictions) */
    double *A, *free, *z, *before; /* (count^2), (count): s- as the base rows leave it, impulses */
    double *slip, *zero, *right;   /* (m) */
    double *force, *dv;            /* (nv) */
} FrictionalImpact;

size_t frictional_impact_doubles(const System *s) {
    const size_t rows = (size_t)(s->contacts + 2 * s->frictions), m = (size_t)s->m, n = (size_t)s->nv;
    return rows * rows + 3 * rows + 4 * m + 3 * n;
}

size_t frictional_impact_ints(const System *s) {
    return (size_t)(s->contacts + 2 * s->frictions + s->frictions + s->m);
}

/* Rows that are struck, frictions that have a normal force of them; 0 if there are none. */
static int find_struck_rows(FrictionalImpact *x, const int *entering) {
    const System *s = x->s->system;
    x->count = 0;
    for (int c = 0; c < s->contacts; c++)
        if (entering[c]) x->rows[x->count++] = s->contact[c];
    x->contacts = x->count;
    for (int i = 0; i < s->frictions; i++) {
        const Friction *law = &s->friction[i];
        x->loaded[i] = 0;
        for (int k = law->first; law->gated && k < law->first + law->normals; k++)
            for (int r = 0; r < x->contacts; r++) x->loaded[i] |= x->rows[r] == s->normal_row[k];
        for (int r = 0; r < law->rows && x->loaded[i]; r++) x->rows[x->count++] = law->row[r];
    }
    return x->count > x->contacts;
}

/* Factors the rows that act with both signs; A and the free slip velocities of the others. */
static Status reduce_frictional(FrictionalImpact *x, const int *entering, int *active, double *Lambda) {
    const System *s = x->s->system;
    Linear *l = &x->b->linear;
    system_active(s, entering, active);
    for (int c = 0; c < s->contacts; c++) active[s->contact[c]] = 0;
    if (linear_factor(l, x->b->M, x->b->G, active) != OK) return FAILED;
    for (int k = 0; k < s->m; k++) {
        x->right[k] = -x->slip[k];
        x->zero[k] = 0;
    }
    if (linear_nearest(l, NULL, x->right, x->dv, NULL) != OK) return FAILED;
    for (int i = 0; i < x->count; i++)
        x->free[i] = x->slip[x->rows[i]] + mechanism_row(x->b, x->rows[i], x->dv);
    return impact_compliance(x->b, x->count, x->rows, x->force, x->zero, (Impulse){x->dv, Lambda}, x->A);
}

/* A z + free + e s- of row i. */
static double slip_after(const FrictionalImpact *x, int i, const double *e) {
    double sum = x->free[i] + (i < x->contacts ? e[x->rows[i]] * x->slip[x->rows[i]] : 0);
    for (int j = 0; j < x->count; j++) sum += x->A[i * x->count + j] * x->z[j];
    return sum;
}

/* One friction: its impulses moved against the slip, and back into the cone. */
static void solve_cone(FrictionalImpact *x, int i, int first, const double *e) {
    const System *s = x->s->system;
    const Friction *law = &s->friction[i];
    const struct FrictionForces *f = x->b->friction;
    double normal = 0, most = 0, length = 0, moved[2] = {0, 0};
    for (int k = law->first; k < law->first + law->normals; k++)
        for (int r = 0; r < x->contacts; r++)
            if (x->rows[r] == s->normal_row[k]) normal += f->c[k] * x->z[r];
    for (int r = 0; r < law->rows; r++)
        most = fmax(most, x->A[(first + r) * x->count + first + r]);
    if (!(most > 0)) return;
    for (int r = 0; r < law->rows; r++) moved[r] = x->z[first + r] - slip_after(x, first + r, e) / most;
    length = hypot(moved[0], moved[1]);
    const double radius = f->mu[2 * i + 1] * fmax(normal, 0);
    const double part = length > radius ? radius / length : 1;
    for (int r = 0; r < law->rows; r++) x->z[first + r] = part * moved[r];
}

/* The impulses; 0 if the sweeps do not arrive. */
static int sweep(FrictionalImpact *x, const double *e) {
    const System *s = x->s->system;
    double change = HUGE_VAL, most = 0;
    memset(x->z, 0, (size_t)x->count * sizeof *x->z);
    for (int round = 0; round < FRICTIONAL_SWEEPS; round++) {
        memcpy(x->before, x->z, (size_t)x->count * sizeof *x->z);
        for (int i = 0; i < x->contacts; i++) {
            const double own = x->A[i * x->count + i];
            if (own > 0) x->z[i] = fmax(0, x->z[i] - slip_after(x, i, e) / own);
        }
        for (int i = 0, first = x->contacts; i < s->frictions; i++) {
            if (!x->loaded[i]) continue;
            solve_cone(x, i, first, e);
            first += s->friction[i].rows;
        }
        change = most = 0;
        for (int i = 0; i < x->count; i++) {
            change = fmax(change, fabs(x->z[i] - x->before[i]));
            most = fmax(most, fabs(x->z[i]));
        }
        if (change <= FRICTIONAL_CLOSE * most) break;
    }
    return change <= FRICTIONAL_ROUGH * most;
}

/* Velocities and all impulses that go with z. */
static Status finish_frictional(FrictionalImpact *x, double *dv, double *Lambda) {
    const System *s = x->s->system;
    memset(x->force, 0, (size_t)s->nv * sizeof *x->force);
    for (int i = 0; i < x->count; i++) mechanism_push(x->b, x->rows[i], x->z[i], x->force);
    for (int k = 0; k < s->m; k++) x->right[k] = -x->slip[k];
    const Status status = linear_nearest(&x->b->linear, x->force, x->right, dv, Lambda);
    for (int i = 0; i < x->count; i++) Lambda[x->rows[i]] = x->z[i];
    return status;
}

Status frictional_impact(Solver *s, Instant at, const double *q, const double *v, const int *entering,
               const double *slip, double *e, Impulse plastic, Impulse found, int *done) {
    const System *system = s->system;
    const int rows = system->contacts + 2 * system->frictions, m = system->m;
    FrictionalImpact x = {.s = s, .b = &s->stepped, .rows = s->part.frictions->struck, .A = s->part.frictions->impact};
    int *active;
    x.loaded = x.rows + rows;
    active = x.loaded + system->frictions;
    x.free = x.A + rows * rows;
    x.z = x.free + rows;
    x.before = x.z + rows;
    x.slip = x.before + rows;
    x.zero = x.slip + m;
    x.right = x.zero + m;
    x.force = x.right + m;
    x.dv = x.force + system->nv;
    memcpy(x.slip, slip, (size_t)m * sizeof *slip);
    *done = 0;
    if (!find_struck_rows(&x, entering)) return OK;
    friction_coefficients(x.b, at, q, v);
    if (reduce_frictional(&x, entering, active, plastic.Lambda) != OK) return FAILED;
    if (!sweep(&x, e)) return OK;
    if (finish_frictional(&x, found.dv, found.Lambda) != OK) return FAILED;
    memset(e, 0, (size_t)m * sizeof *e);
    *done = sweep(&x, e);
    return *done ? finish_frictional(&x, plastic.dv, plastic.Lambda) : OK;
}

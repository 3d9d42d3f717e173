/* norms.c -- sliding under normal forces that are norms of multipliers: the friction of joints.
 *
 * With all that is linear solved before, the multipliers are lambda0 - sum_g mu_g N_g lambda_g, and
 *
 *   N_i = Phi_i(N) = sum |load_i + c_i (lambda0 - sum_g mu_g N_g lambda_g)|       (sum over the norms of i)
 *
 * with |dPhi_i/dN_g| <= B_ig = mu_g sum |c_i lambda_g|.  Phi contracts if the spectral radius of B is below 1, that
 * is if 1 - B is an M-matrix: (1 - B) w = 1 has a solution w > 0, and in the norm max |x_i|/w_i Phi contracts by
 * 1 - 1/max w (Berman & Plemmons, Nonnegative Matrices in the Mathematical Sciences, 1994, th. 6.2.3).  Then there
 * is one solution, by Banach's theorem.  Of one joint, |N| = |a - N b| has exactly one root N >= 0 for every a
 * where |b| < 1; of several the test is sufficient only.
 *
 * Newton's method is sliding.c's own equation (1 + A) N = load + c lambda0, with load and c along the unit vectors
 * of the norms; where it does not bring N nearer, a step of the contraction does. */
#include "friction.h"

#include <float.h>
#include <string.h>

#include "digits.h"

enum { NORMS_ROUNDS = 200, NORMS_POWERS = 100 };
static const double NORMS_ARRIVED = 1e-12; /* of the normal forces: rounding, where nothing brings them nearer */

size_t norms_doubles(const System *s) {
    const size_t count = (size_t)s->frictions;
    return count * count + 4 * count + (size_t)s->m;
}

/* Those that slip, from `first` on with norms. */
typedef struct {
    Mechanism *b;
    int first, count;   /* place of the first in f->sliding, and how many with norms */
    double *B;          /* (count^2) */
    double *w;          /* (count) in units of which N is measured */
    double *N, *next, *found; /* (count) normal forces: tried, by Newton's method, Phi of the ones or the others */
    double *lambda;     /* (m) multipliers under them */
} Norms;

static int friction_of(const Norms *x, int g) { return x->b->friction->sliding[x->first + g]; }
static double mu_of(const Norms *x, int g) { return friction_sliding(x->b->friction, friction_of(x, g)); }
static double *response_to(const Norms *x, int g) {
    return x->b->friction->pushed + (x->first + g) * x->b->system->m;
}

/* The motion to the push of one of them alone: those without norms react to it. */
static void let_react(const Norms *x, int g) {
    const System *s = x->b->system;
    struct FrictionForces *f = x->b->friction;
    double *pushed = response_to(x, g), *answer = f->answer + (x->first + g) * s->nv;
    for (int h = 0; h < x->first; h++) {
        const int i = f->sliding[h];
        f->right[h] = f->stick_slip[i].sign * (friction_normal(x->b, i, pushed) - f->load[i]);
    }
    memcpy(f->A, f->minor, (size_t)(x->first * x->first) * sizeof *f->A);
    (void)painleve_eliminate(x->first, f->A, f->right);
    for (int h = 0; h < x->first; h++) {
        const double strength = friction_sliding(f, f->sliding[h]) * f->right[h];
        for (int j = 0; j < s->nv; j++) answer[j] -= strength * f->answer[h * s->nv + j];
        for (int k = 0; k < s->m; k++) pushed[k] -= strength * f->pushed[h * s->m + k];
    }
}

/* B: what the friction of each adds to the normal force of each, at most. */
static void find_bounds(const Norms *x) {
    for (int g = 0; g < x->count; g++) {
        const double *response = response_to(x, g);
        for (int i = 0; i < x->count; i++)
            x->B[i * x->count + g] = mu_of(x, g) * friction_norms(x->b, friction_of(x, i), 0, response);
    }
}

/* The spectral radius of B, by powers of it. */
static double radius_of_bounds(const Norms *x) {
    double radius = 0;
    for (int i = 0; i < x->count; i++) x->N[i] = 1;
    for (int round = 0; round < NORMS_POWERS; round++) {
        radius = 0;
        for (int i = 0; i < x->count; i++) {
            x->next[i] = 0;
            for (int g = 0; g < x->count; g++) x->next[i] += x->B[i * x->count + g] * x->N[g];
            radius = fmax(radius, x->next[i]);
        }
        for (int i = 0; i < x->count && radius > 0; i++) x->N[i] = (x->next[i] / radius + x->N[i]) / 2;
    }
    return radius;
}

static Status refuse_joints(const Norms *x, double t) {
    const Mechanism *b = x->b;
    fail(b->why, "friction ");
    for (int g = 0; g < x->count; g++)
        why_append(b->why, "%s'%s'", g > 0 ? ", " : "", b->system->friction[friction_of(x, g)].name);
    why_append(b->why,
               ": the acceleration of sliding cannot be shown unique at t = %s s (frictions may load the joints by "
               "%.3g of themselves, the spectral radius of |d tau/d tau|, expected below 1): use a smaller coefficient "
               "of friction or a smaller radius",
               digits(t).text, radius_of_bounds(x));
    return FAILED;
}

/* One joint with one norm: beyond 1 there are forces under which it has no motion, or two. */
static Status refuse_joint(const Norms *x, double t, int g) {
    const Mechanism *b = x->b;
    return fail(b->why,
                "friction '%s': sliding has no acceleration, or several, at t = %s s (friction would load its "
                "joint by %.3g of itself, mu |d N/d lambda|, expected below 1): use a smaller coefficient of "
                "friction or a smaller radius",
                b->system->friction[friction_of(x, g)].name, digits(t).text, x->B[g * x->count + g]);
}

static int has_one_norm(const Norms *x, int g) {
    const System *s = x->b->system;
    const Friction *law = &s->friction[friction_of(x, g)];
    int norms = 0;
    for (int p = law->part; p < law->part + law->parts; p++) norms += s->normal_part[p].begins;
    return norms == 1;
}

/* w; FAILED unless it is positive. */
static Status find_units(const Norms *x, double t) {
    struct FrictionForces *f = x->b->friction;
    const int count = x->count;
    int positive = 1;
    for (int i = 0; i < count; i++) {
        if (!(x->B[i * count + i] < 1 - PAINLEVE_SAFE) && has_one_norm(x, i)) return refuse_joint(x, t, i);
        for (int g = 0; g < count; g++) f->A[i * count + g] = (i == g) - x->B[i * count + g];
        x->w[i] = 1;
    }
    positive = painleve_eliminate(count, f->A, x->w) > 0;
    for (int i = 0; i < count; i++) positive &= 0 < x->w[i] && x->w[i] < 1 / PAINLEVE_SAFE;
    return positive ? OK : refuse_joints(x, t);
}

/* x->lambda under the normal forces N, Phi of them in `next`; how far they are from each other. */
static double find_forces(const Norms *x, const double *N, double *next) {
    const int m = x->b->system->m;
    double away = 0;
    memcpy(x->lambda, x->b->lambda, (size_t)m * sizeof *x->lambda);
    for (int g = 0; g < x->count; g++) {
        const double strength = mu_of(x, g) * N[g], *response = response_to(x, g);
        for (int k = 0; k < m; k++) x->lambda[k] -= strength * response[k];
    }
    for (int i = 0; i < x->count; i++) {
        next[i] = friction_norms(x->b, friction_of(x, i), 1, x->lambda);
        away = fmax(away, fabs(next[i] - N[i]) / x->w[i]);
    }
    return away;
}

/* load and c of friction i along the unit vectors of its norms under x->lambda. */
static void point_along(const Norms *x, int i) {
    const System *s = x->b->system;
    struct FrictionForces *f = x->b->friction;
    const Friction *law = &s->friction[i];
    f->load[i] = 0;
    for (int p = law->part, end; p < law->part + law->parts; p = end) {
        const double length = friction_norm(x->b, i, p, 1, x->lambda, &end);
        for (int of = p; of < end; of++) {
            const NormalPart *part = &s->normal_part[of];
            const double along = length > 0 ? friction_part(x->b, of, 1, x->lambda) / length : 0;
            f->load[i] += along * f->part_load[of];
            for (int k = part->first; k < part->first + part->normals; k++) f->c[k] = along * f->part_c[k];
        }
    }
}

/* Newton's method from x->lambda: x->found.  Returns the determinant of its matrix. */
static double find_by_newton(const Norms *x) {
    struct FrictionForces *f = x->b->friction;
    const int count = x->count;
    for (int i = 0; i < count; i++) {
        const int of = friction_of(x, i);
        point_along(x, of);
        x->found[i] = friction_normal(x->b, of, x->b->lambda);
        for (int g = 0; g < count; g++)
            f->A[i * count + g] = (i == g) + mu_of(x, g) * (friction_normal(x->b, of, response_to(x, g)) -
                                                                 f->load[of]);
    }
    return painleve_eliminate(count, f->A, x->found);
}

/* N; FAILED if it is not reached. */
static Status find_normals(const Norms *x, double t, double *determinant) {
    const size_t bytes = (size_t)x->count * sizeof *x->N;
    memset(x->N, 0, bytes);
    const double size = find_forces(x, x->N, x->next);
    double away = size;
    *determinant = find_by_newton(x);
    for (int round = 0; away > 0 && round < NORMS_ROUNDS; round++) {
        const double left = find_forces(x, x->found, x->next);
        if (left < away) {
            memcpy(x->N, x->found, bytes);
            away = left;
        } else {
            away = find_forces(x, x->N, x->next);
            if (away <= NORMS_ARRIVED * size) break;
            memcpy(x->N, x->next, bytes);
            away = find_forces(x, x->N, x->next);
        }
        *determinant = find_by_newton(x);
    }
    return away <= NORMS_ARRIVED * size ? OK : refuse_joints(x, t);
}

/* vdot, lambda and the normal forces, as the norms' frictions are added to what is there. */
static void add_forces(const Norms *x) {
    Mechanism *b = x->b;
    const System *s = b->system;
    struct FrictionForces *f = b->friction;
    for (int g = 0; g < x->count; g++) {
        const double strength = mu_of(x, g) * x->N[g];
        const double *answer = f->answer + (x->first + g) * s->nv, *response = response_to(x, g);
        f->normal[friction_of(x, g)] = x->N[g];
        for (int j = 0; j < s->nv; j++) b->vdot[j] -= strength * answer[j];
        for (int k = 0; k < s->m; k++) b->lambda[k] -= strength * response[k];
    }
    for (int h = 0; h < x->first; h++) {
        const int i = f->sliding[h];
        f->normal[i] = f->stick_slip[i].sign * friction_normal(b, i, b->lambda);
    }
}

/* 1 + A of all that slip, where those without norms react to the others already. */
static void note_minor(const Norms *x) {
    const Mechanism *b = x->b;
    struct FrictionForces *f = b->friction;
    const int count = x->first + x->count;
    for (int h = 0; h < count; h++) {
        const int i = f->sliding[h];
        const double sign = h < x->first ? f->stick_slip[i].sign : 1;
        for (int g = 0; g < count; g++) {
            const double own = friction_normal(b, i, f->pushed + g * b->system->m) - f->load[i];
            const int reacted = h < x->first && g >= x->first;
            f->minor[h * count + g] = (h == g) + (reacted ? 0 : sign * friction_sliding(f, f->sliding[g]) * own);
        }
    }
}

Status norms_slide(Mechanism *b, double t, int linear, int count, double *determinant) {
    const int frictions = b->system->frictions;
    Norms x = {.b = b, .first = linear, .count = count - linear, .B = b->friction->norms};
    double own;
    x.w = x.B + frictions * frictions;
    x.N = x.w + frictions;
    x.next = x.N + frictions;
    x.found = x.next + frictions;
    x.lambda = x.found + frictions;
    for (int g = 0; g < x.count; g++) let_react(&x, g);
    find_bounds(&x);
    if (find_units(&x, t) != OK || find_normals(&x, t, &own) != OK) return FAILED;
    *determinant *= own;
    note_minor(&x);
    add_forces(&x);
    return OK;
}

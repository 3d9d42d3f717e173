/* friction.h -- Coulomb friction in given modes: rows that stick act, rows that slip push against the slip.
 *
 *   sticks   G_t v = nu_t ,  |lambda_t| <= mu_s N
 *   slips    lambda_t = -mu_k N s/|s| ,  s = G_t v - nu_t      (Pfeiffer & Glocker 1996, ch. 5)
 *
 * N is |load + c lambda|, or a sum of norms of such components, as in a joint (norms.c).  In the equations it is
 * linear, N = load + c lambda: with a sign, or along the unit vectors of the norms' components.
 *
 * Which of them stick is decided in stick_slip.c. */
#ifndef LAGFMU_FRICTION_H
#define LAGFMU_FRICTION_H

#include "linkage.h"
#include "mechanism.h"

static const double PAINLEVE_SAFE = 1e-9; /* 1 + A below this counts as not positive */

/* What frictions do at the state of the latest motion; two entries a friction where a row is meant, the
 * second 0 where there is only one. */
struct FrictionForces {
    const StickSlip *stick_slip; /* (frictions) the modes that hold */
    int *acting;         /* (m) rows that act, those that stick by friction among them */
    int *loaded;         /* (frictions) 1: a normal force acts */
    int *held;           /* (frictions) 1: of one row that those that act leave no slip: it bears what is static */
    double *mu;          /* (2 frictions) static, kinetic */
    double *part_load;   /* (normal_parts) components of the normal forces, ... */
    double *part_c;      /* (normal_rows) ... and what multipliers add to them */
    double *load;        /* (frictions) N = load + c lambda */
    double *c;           /* (normal_rows) */
    double *normal;      /* (frictions): with its sign while it slips, its magnitude while it sticks */
    double *slip;        /* (2 frictions) */
    double *tangential;  /* (2 frictions) multipliers */
    double *towards;     /* (2 frictions) direction of slip */
    double *reserve;     /* (frictions) mu_s N - |lambda_t| over their sum, of the best lambda */
    /* of the latest motion, for sliding_along.c; else scratch: */
    int *sliding;        /* (frictions) those that slip, whose normal forces are norms last, ... */
    int slipping;        /* ... and how many these are */
    double *d, *zero, *first, *right; /* (nv), (m), (m), (frictions) */
    double *answer;      /* (frictions nv) accelerations, to each d alone */
    double *pushed;      /* (frictions m) multipliers, to each d alone */
    double *A, *minor;   /* (frictions^2), and 1 + A of those that slip */
    double *norms;       /* of norms.c */
    double *nonunique;   /* of nonunique.c */
};

/* sliding.c -- what a Mechanism with frictions does besides (optional.h); NULL in an FMU without. */
SHARED const Sliding SLIDING;

/* mu, and the normal forces by their components; load and c of those that have one. */
SHARED void friction_coefficients(Mechanism *b, Instant at, const double *q, const double *v);

/* norms.c -- what the frictions f->sliding[linear ... count - 1], whose normal forces are norms, add to vdot and
 * lambda, f->normal of all that slip, and 1 + A of them in f->minor; `determinant`: times theirs.  FAILED where
 * they have no solution, or it cannot be shown to be the only one. */
SHARED Status norms_slide(Mechanism *b, double t, int linear, int count, double *determinant);
SHARED size_t norms_doubles(const System *s);

/* G_t v - nu_t of friction i at the state that was evaluated last. */
static inline void friction_slip(const Mechanism *b, int i, const double *v, double s[2]) {
    const Friction *law = &b->system->friction[i];
    s[1] = 0;
    for (int r = 0; r < law->rows; r++) s[r] = mechanism_slip(b, law->row[r], v);
}

/* load + c lambda of friction i. */
static inline double friction_normal(const Mechanism *b, int i, const double *lambda) {
    const Friction *law = &b->system->friction[i];
    double sum = b->friction->load[i];
    for (int k = law->first; k < law->first + law->normals; k++)
        sum += b->friction->c[k] * lambda[b->system->normal_row[k]];
    return sum;
}

/* Component p of a normal force; `share` of the load: 1 under the multipliers of a motion, 0 for a change of
 * them. */
static inline double friction_part(const Mechanism *b, int p, double share, const double *lambda) {
    const NormalPart *part = &b->system->normal_part[p];
    double sum = share * b->friction->part_load[p];
    for (int k = part->first; k < part->first + part->normals; k++)
        sum += b->friction->part_c[k] * lambda[b->system->normal_row[k]];
    return sum;
}

/* The length of the norm that begins with component p of friction i; `end`: where the next one does. */
static inline double friction_norm(const Mechanism *b, int i, int p, double share, const double *lambda,
                                   int *end) {
    const int last = b->system->friction[i].part + b->system->friction[i].parts;
    double length = fabs(friction_part(b, p, share, lambda));
    for (*end = p + 1; *end < last && !b->system->normal_part[*end].begins; *end += 1)
        length = hypot(length, friction_part(b, *end, share, lambda));
    return length;
}

/* The normal force of friction i, the sum of its norms: never negative. */
static inline double friction_norms(const Mechanism *b, int i, double share, const double *lambda) {
    const Friction *law = &b->system->friction[i];
    double sum = 0;
    for (int p = law->part, end; p < law->part + law->parts; p = end)
        sum += friction_norm(b, i, p, share, lambda, &end);
    return sum;
}

/* The coefficient of friction i, which does not stick. */
static inline double friction_sliding(const struct FrictionForces *f, int i) {
    return f->held[i] ? f->mu[2 * i] : f->mu[2 * i + 1];
}

/* The length of a vector in two rows, or, mostly, in one. */
static inline double friction_length(const double x[2]) { return x[1] == 0 ? fabs(x[0]) : hypot(x[0], x[1]); }

/* The tangential multipliers of friction i, and their length. */
static inline double friction_tangential(const Mechanism *b, int i, const double *lambda, double force[2]) {
    const Friction *law = &b->system->friction[i];
    force[1] = 0;
    for (int r = 0; r < law->rows; r++) force[r] = lambda[law->row[r]];
    return friction_length(force);
}

/* The unit vector of the slip velocity s; beyond a stop it goes on as before, so that the equations of a
 * segment stay smooth there. */
static inline void friction_heading(const StickSlip *mode, const double s[2], double e[2]) {
    const double length = friction_length(s);
    e[0] = mode->direction[0];
    e[1] = mode->direction[1];
    if (!(length > mode->noise) || (s[1] == 0 && e[1] == 0)) return;
    if (s[0] * e[0] + s[1] * e[1] < 0) return;
    e[0] = s[0] / length;
    e[1] = s[1] / length;
}

/* painleve.c -- the refusal of a sliding problem that has no acceleration, or several. */
SHARED Status painleve_paradox(const Mechanism *b, double t, const int *which, int count, double value);

/* FAILED where that is so with some of the contacts open; `determinant` of 1 + A, which is in f->minor, of
 * the `count` frictions that slip. */
SHARED Status painleve_departures(Mechanism *b, double t, int count, double determinant);

/* Gauss's elimination with row exchanges of A x = right, (size, size); the determinant. */
SHARED double painleve_eliminate(int size, double *A, double *right);

/* nonunique.c -- redundant sticking: of the multipliers that hold the same motion, b->lambda becomes the one of
 * least norm within the cones, or the nearest to it; `best` (m): those of the largest least reserve. */
SHARED size_t nonunique_doubles(const System *s);
SHARED void nonunique_best(Mechanism *b, double *best);

/* 0 if the normal force of friction i is not the only one with the motion that was evaluated last: rows that
 * depend on each other share it. */
SHARED int normal_is_unique(Mechanism *b, int i);
SHARED int friction_is_unique(Mechanism *b, int i); /* the same of its own multipliers */

#endif

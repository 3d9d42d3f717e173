/* friction.c -- Coulomb's law of a friction at one state: coefficients, normal force, slip velocity. */
#include "friction.h"

#include "digits.h"

Status friction_coefficients(Mechanism *b, Instant at, const double *q, const double *v) {
    const System *s = b->system;
    struct FrictionForces *f = b->friction;
    s->coulomb(at.t, q, v, at.u, at.p, f->mu, f->load, f->c);
    for (int i = 0; i < s->frictions; i++) {
        if (0 <= f->mu[2 * i + 1] && f->mu[2 * i + 1] <= f->mu[2 * i] && f->mu[2 * i] < HUGE_VAL)
            continue;
        return fail(b->why,
                    "friction '%s' has the coefficients static = %s and kinetic = %s at t = %s s, "
                    "expected 0 <= kinetic <= static",
                    s->friction[i].name, digits(f->mu[2 * i]).text, digits(f->mu[2 * i + 1]).text,
                    digits(at.t).text);
    }
    return OK;
}

void friction_slip(const Mechanism *b, int i, const double *v, double s[2]) {
    const Friction *law = &b->system->friction[i];
    s[1] = 0;
    for (int r = 0; r < law->rows; r++) s[r] = mechanism_slip(b, law->row[r], v);
}

double friction_normal(const Mechanism *b, int i, const double *lambda) {
    const Friction *law = &b->system->friction[i];
    double sum = b->friction->load[i];
    for (int k = law->first; k < law->first + law->normals; k++)
        sum += b->friction->c[k] * lambda[b->system->normal_row[k]];
    return sum;
}

/* Mostly of one row. */
static double length_of(const double x[2]) { return x[1] == 0 ? fabs(x[0]) : hypot(x[0], x[1]); }

void friction_heading(const StickSlip *mode, const double s[2], double e[2]) {
    const double length = length_of(s);
    e[0] = mode->direction[0];
    e[1] = mode->direction[1];
    if (!(length > mode->noise) || (s[1] == 0 && e[1] == 0)) return;
    if (s[0] * e[0] + s[1] * e[1] < 0) return;
    e[0] = s[0] / length;
    e[1] = s[1] / length;
}

double friction_tangential(const Mechanism *b, int i, const double *lambda, double force[2]) {
    const Friction *law = &b->system->friction[i];
    force[1] = 0;
    for (int r = 0; r < law->rows; r++) force[r] = lambda[law->row[r]];
    return length_of(force);
}

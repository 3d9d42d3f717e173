/* sliding_along.c -- the equations of sliding (sliding.c), differentiated along a direction.
 *
 *   M dvdot = b + G_t^T dlambda_t + G^T dlambda ,  G dvdot = c ,   lambda_t = -mu N e ,  e = s/|s| ,
 *   dlambda_t = -(dmu N + mu dN) e - mu N de ,   de = (ds - (e . ds) e) / |s| ,
 *
 * with b and c of sensitivity.c, in which lambda_t stands among the multipliers.  N = load + c lambda with its sign, or
 * along the unit vectors of its norms, whose own change is orthogonal to them, so that
 *
 *   dN = dload + dc lambda + c dlambda ,   (1 + A) dN = dload + dc lambda + c dlambda0
 *
 * with 1 + A and the answers to unit pushes of the latest motion, and dlambda0 as it would be if N stayed. */
#include <string.h>

#include "friction.h"
#include "sensitivity.h"

/* The change of lambda_t with N held, (2): by mu, and by the direction of the slip. */
static void push_of_held(const Sensitivity *w, const Mechanism *b, int i, const double *v, const double *dv,
                         double change[2]) {
    const Friction *law = &b->system->friction[i];
    const struct FrictionForces *f = b->friction;
    const double *s = f->slip + 2 * i, *e = f->towards + 2 * i;
    const double N = f->normal[i], length = friction_length(s), dmu = w->dmu[2 * i + !f->held[i]];
    const int turns = law->rows > 1 && length > f->stick_slip[i].noise && s[0] * e[0] + s[1] * e[1] > 0;
    double ds[2] = {0, 0};
    for (int r = 0; r < law->rows && turns; r++) ds[r] = sensitivity_slip(w, b, law->row[r], v, dv);
    const double along = e[0] * ds[0] + e[1] * ds[1];
    for (int r = 0; r < 2; r++) {
        const double de = turns ? (ds[r] - along * e[r]) / length : 0;
        change[r] = -dmu * N * e[r] - friction_sliding(f, i) * N * de;
    }
}

/* The sign of N while it slips, else the component of the unit vector of the norm of this length. */
static double direction_of(const Mechanism *b, int i, int part, double length) {
    const StickSlip *mode = &b->friction->stick_slip[i];
    if (b->system->friction[i].parts == 1 && !mode->sticks) return mode->sign;
    return length > 0 ? friction_part(b, part, 1, b->lambda) / length : 0;
}

/* dN of friction i with w->dlambda. */
static double change_of_normal(const Sensitivity *w, const Mechanism *b, int i) {
    const System *s = b->system;
    const Friction *law = &s->friction[i];
    double sum = 0;
    for (int p = law->part, end; p < law->part + law->parts; p = end) {
        const double length = friction_norm(b, i, p, 1, b->lambda, &end);
        for (int of = p; of < end; of++) {
            const NormalPart *part = &s->normal_part[of];
            double change = w->dpart_load[of];
            for (int k = part->first; k < part->first + part->normals; k++)
                change += w->dpart_c[k] * b->lambda[s->normal_row[k]] +
                          b->friction->part_c[k] * w->dlambda[s->normal_row[k]];
            sum += direction_of(b, i, of, length) * change;
        }
    }
    return sum;
}

/* dvdot and dlambda, of which those of the frictions that slip come last. */
static Status solve_along(Sensitivity *w, Mechanism *b, const double *v, Direction d) {
    const System *s = b->system;
    struct FrictionForces *f = b->friction;
    const int n = s->nv, m = s->m, count = f->slipping;
    for (int g = 0; g < count; g++) {
        const int i = f->sliding[g];
        push_of_held(w, b, i, v, d.dv, w->dpush + 2 * i);
        for (int r = 0; r < s->friction[i].rows; r++)
            mechanism_push(b, s->friction[i].row[r], w->dpush[2 * i + r], w->b);
    }
    if (linear_solve(&b->linear, w->b, w->c, w->dvdot, w->dlambda) != OK) return FAILED;
    for (int g = 0; g < count; g++) f->right[g] = change_of_normal(w, b, f->sliding[g]);
    memcpy(f->A, f->minor, (size_t)(count * count) * sizeof *f->A);
    (void)painleve_eliminate(count, f->A, f->right);
    for (int g = 0; g < count; g++) {
        const double strength = friction_sliding(f, f->sliding[g]) * f->right[g];
        for (int j = 0; j < n; j++) w->dvdot[j] -= strength * f->answer[g * n + j];
        for (int k = 0; k < m; k++) w->dlambda[k] -= strength * f->pushed[g * m + k];
    }
    for (int g = 0; g < count; g++) {
        const int i = f->sliding[g];
        const double strength = friction_sliding(f, i) * change_of_normal(w, b, i);
        for (int r = 0; r < s->friction[i].rows; r++)
            w->dlambda[s->friction[i].row[r]] = w->dpush[2 * i + r] - strength * f->towards[2 * i + r];
    }
    return OK;
}

/* The same where multipliers are given, with what their laws then make of those of the frictions that slip in w->dpush. */
static Status solve_given(Sensitivity *w, Mechanism *b, const double *v, Direction d) {
    const System *s = b->system;
    const struct FrictionForces *f = b->friction;
    for (int g = 0; g < f->slipping; g++) {
        const int i = f->sliding[g];
        const double strength = friction_sliding(f, i) * change_of_normal(w, b, i);
        push_of_held(w, b, i, v, d.dv, w->dpush + 2 * i);
        for (int r = 0; r < s->friction[i].rows; r++) w->dpush[2 * i + r] -= strength * f->towards[2 * i + r];
    }
    return linear_solve(&b->linear, w->b, w->c, w->dvdot, NULL);
}

/* Are all multipliers the only ones that friction i is made of? */
static int is_only_one(Mechanism *b, int i) {
    const System *s = b->system;
    const Friction *law = &s->friction[i];
    int all = 1;
    if (b->given != NULL) return !b->dependent || (normal_is_unique(b, i) && friction_is_unique(b, i));
    for (int r = 0; r < law->rows; r++) all &= b->linear.unique[law->row[r]];
    for (int k = law->first; k < law->first + law->normals; k++) all &= b->linear.unique[s->normal_row[k]];
    return all;
}

/* Of what is reported: slip velocities, reserves  mu_s N - |lambda_t|  and powers  lambda_t . s. */
static void find_reported(Sensitivity *w, Mechanism *b, const double *v, const double *dv) {
    const System *s = b->system;
    const struct FrictionForces *f = b->friction;
    for (int i = 0; i < s->frictions; i++) {
        const Friction *law = &s->friction[i];
        const double *force = f->tangential + 2 * i, *slip = f->slip + 2 * i, length = friction_length(force);
        const int slips = !f->stick_slip[i].sticks && !f->held[i];
        double along = 0, power = 0;
        w->dslip[2 * i + 1] = 0;
        for (int r = 0; r < law->rows; r++) {
            const double dforce = w->dlambda[law->row[r]];
            w->dslip[2 * i + r] = sensitivity_slip(w, b, law->row[r], v, dv);
            along += force[r] * dforce;
            power += dforce * slip[r] + force[r] * w->dslip[2 * i + r];
        }
        const double normal = w->dnormal[i] = f->loaded[i] ? change_of_normal(w, b, i) : 0;
        w->dmargin[i] = w->dmu[2 * i] * f->normal[i] + f->mu[2 * i] * normal - (length > 0 ? along / length : 0);
        if (!is_only_one(b, i)) w->dmargin[i] = NAN;
        w->dpower[i] = slips ? power : 0;
    }
}

Status sliding_along(Sensitivity *w, Mechanism *b, Instant at, const double *q, const double *v, Direction d) {
    if (b->friction->slipping > 0 || !b->stage)
        b->system->coulomb_tangent(at.t, q, v, at.u, at.p, d.dt, d.dq, d.dv, d.du, d.dp, w->dmu, w->dpart_load,
                                   w->dpart_c);
    if ((b->given != NULL ? solve_given(w, b, v, d) : solve_along(w, b, v, d)) != OK) return FAILED;
    if (!b->stage) find_reported(w, b, v, d.dv);
    return OK;
}

/* sensitivity.c -- the equations of motion, differentiated along a direction.
 *
 *   M vdot = F + G^T lambda ,  G vdot = gamma ,  q' = B v + b
 *
 * gives, with the changes dM, dF, dG, dgamma of the coefficients (system->tangent, symbolic),
 *
 *   M dvdot = b + G^T dlambda ,  G dvdot = c ,
 *   b = dF + dG^T lambda - dM vdot ,  c = dgamma - dG vdot ,  dq' = B dv + dB v + db
 *
 * (where the multipliers are given, M dvdot = b + G^T dlambda with their change alone),
 * a further solve with the factors that gave vdot and lambda (implicit function theorem; Hairer &
 * Wanner II, sect. VII.1, for index-1 equations). */
#include "sensitivity.h"

#include <math.h>
#include <string.h>

void sensitivity_layout(Sensitivity *w, Arena *arena, const System *s) {
    w->dM = arena_doubles(arena, s->masses);
    w->dF = arena_doubles(arena, s->nv);
    w->dG = arena_doubles(arena, s->entries);
    w->dnu = arena_doubles(arena, s->m);
    w->dgamma = arena_doubles(arena, s->m);
    w->df = arena_doubles(arena, s->m);
    w->dB = arena_doubles(arena, s->rates);
    w->drate = arena_doubles(arena, s->nq);
    w->dvdot = arena_doubles(arena, s->nv);
    w->dlambda = arena_doubles(arena, s->m);
    w->b = arena_doubles(arena, s->nv);
    w->c = arena_doubles(arena, s->m);
    w->dq = arena_doubles(arena, s->nq);
    w->dv = arena_doubles(arena, s->nv);
    w->du = arena_doubles(arena, s->inputs);
    w->dp = arena_doubles(arena, s->parameters);
    for (int k = 0; k < s->parameters && w->dp != NULL; k++) w->dp[k] = 0;
    w->dforce = arena_doubles(arena, s->nv);
    w->dgiven = arena_doubles(arena, s->m);
    w->known = arena_doubles(arena, s->m);
    w->down = arena_doubles(arena, s->output_count);
    w->dother = arena_doubles(arena, s->output_count);
    w->slide = NULL;
    w->dmu = arena_doubles(arena, 2 * s->frictions);
    w->dpart_load = arena_doubles(arena, s->normal_parts);
    w->dpart_c = arena_doubles(arena, s->normal_rows);
    w->dpush = arena_doubles(arena, 2 * s->frictions);
    w->dslip = arena_doubles(arena, 2 * s->frictions);
    w->dmargin = arena_doubles(arena, s->frictions);
    w->dpower = arena_doubles(arena, s->frictions);
    w->dnormal = arena_doubles(arena, s->frictions);
}

static void right_sides(Sensitivity *w, const Mechanism *b) {
    const System *s = b->system;
    memcpy(w->b, w->dF, (size_t)s->nv * sizeof *w->b);
    memcpy(w->c, w->dgamma, (size_t)s->m * sizeof *w->c);
    for (int e = 0; e < s->masses; e++) {
        const int i = s->mass_row[e], j = s->mass_column[e];
        w->b[i] -= w->dM[e] * b->vdot[j];
        if (i != j) w->b[j] -= w->dM[e] * b->vdot[i];
    }
    for (int e = 0; e < s->entries; e++) {
        const int k = s->entry_row[e], j = s->entry_column[e];
        w->b[j] += w->dG[e] * b->lambda[k];
        w->c[k] -= w->dG[e] * b->vdot[j];
    }
    for (int k = 0; k < s->m && b->given != NULL; k++) {
        mechanism_push(b, k, w->dgiven[k], w->b);
        w->dlambda[k] = w->dgiven[k];
    }
}

void sensitivity_sides(Sensitivity *w, Mechanism *b, Instant at, const double *q, const double *v, Direction d) {
    const System *s = b->system;
    s->tangent(at.t, q, v, at.u, at.p, d.dt, d.dq, d.dv, d.du, d.dp, w->dM, w->dF, w->dG, w->dnu,
               w->dgamma, w->df, w->denergy);
    if (s->kinematics != NULL)
        KINEMATICS->change(b, at.t, q, v, at.u, at.p, d.dt, d.dq, d.dv, d.du, d.dp, w->dB,
                           w->drate);
    else
        memcpy(w->drate, d.dv, (size_t)s->nq * sizeof *w->drate);
    right_sides(w, b);
}

static Status check_sides(const Sensitivity *w, const Mechanism *b, Instant at) {
    const System *s = b->system;
    for (int j = 0; j < s->nv; j++)
        if (!isfinite(w->b[j]))
            return fail(b->why, "the derivative of the force on %s is not finite at t = %.17g s",
                        s->speeds[j], at.t);
    for (int k = 0; k < s->m; k++)
        if (!isfinite(w->c[k]))
            return fail(b->why, "the derivative of constraint %s is not finite at t = %.17g s",
                        s->rows[k].name, at.t);
    return OK;
}

Status sensitivity_along(Sensitivity *w, Mechanism *b, Instant at, const double *q,
                         const double *v, Direction d) {
    const System *s = b->system;
    sensitivity_sides(w, b, at, q, v, d);
    const Status solved = w->slide != NULL
                              ? w->slide(w, b, at, q, v, d)
                              : linear_solve(&b->linear, w->b, w->c, w->dvdot, b->given != NULL ? NULL : w->dlambda);
    if (solved == OK) return OK; /* linear.h: what it solves is finite */
    if (check_sides(w, b, at) != OK) return FAILED;
    for (int k = 0; k < s->m; k++)
        if (!b->linear.unique[k])
            return fail(b->why,
                        "no accelerations satisfy all constraints beside this state along this direction: "
                        "'%s' follows from others on the constraints alone, and has derivatives only "
                        "along them",
                        s->rows[k].name);
    return FAILED;
}

void sensitivity_of_values(Sensitivity *w, const System *s, Instant at, const double *q,
                             const double *v, Direction d) {
    if (s->tangent == NULL) return;
    s->tangent(at.t, q, v, at.u, at.p, d.dt, d.dq, d.dv, d.du, d.dp, w->dM, w->dF, w->dG, w->dnu,
               w->dgamma, w->df, w->denergy);
}

double sensitivity_slip(const Sensitivity *w, const Mechanism *b, int k, const double *v, const double *dv) {
    const System *s = b->system;
    double change = -w->dnu[k];
    for (int e = s->row_start[k]; e < s->row_start[k + 1]; e++) {
        const int j = s->entry_column[e];
        change += w->dG[e] * v[j] + b->G[e] * dv[j];
    }
    return change;
}

double sensitivity_residual(const Sensitivity *w, const Mechanism *b, int k, const double *v,
                            const double *dv) {
    return b->system->rows[k].kind != NONHOLONOMIC ? w->df[k] : sensitivity_slip(w, b, k, v, dv);
}

Status sensitivity_jacobian(Sensitivity *w, Mechanism *b, Instant at, const int *active,
                            const double *y, double *J, double *dfdt) {
    const int nq = b->system->nq, nv = b->system->nv, ny = system_states(b->system);
    const double *q = y, *v = y + nq;
    Direction d = {0, w->dq, w->dv, w->du, w->dp};
    if (mechanism_motion(b, at, q, v, active) != OK) return FAILED;
    memset(w->dq, 0, (size_t)nq * sizeof *w->dq);
    memset(w->dv, 0, (size_t)nv * sizeof *w->dv);
    memset(w->du, 0, (size_t)b->system->inputs * sizeof *w->du);
    for (int j = 0; j < ny; j++) {
        double *seed = j < nq ? &w->dq[j] : &w->dv[j - nq];
        *seed = 1;
        const Status status = sensitivity_along(w, b, at, q, v, d);
        *seed = 0;
        if (status != OK) return FAILED;
        for (int i = 0; i < nq; i++) J[i * ny + j] = w->drate[i];
        for (int i = 0; i < nv; i++) J[(nq + i) * ny + j] = w->dvdot[i];
    }
    d.dt = 1;
    if (sensitivity_along(w, b, at, q, v, d) != OK) return FAILED;
    memcpy(dfdt, w->drate, (size_t)nq * sizeof *dfdt);
    memcpy(dfdt + nq, w->dvdot, (size_t)nv * sizeof *dfdt);
    return OK;
}

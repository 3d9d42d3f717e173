/* adjoint.c -- see adjoint.h.  With the weights a of dvdot and l of dlambda,
 *
 *   M x + G^T mu = a ,  -G x = l                   (x, mu: the weights of b and c of sensitivity.c)
 *
 * where the multipliers are given  M x = a , and theirs are  l + G x . */
#include "adjoint.h"

#include <math.h>
#include <string.h>

static void clear(double *values, int count) {
    for (int i = 0; i < count; i++) values[i] = 0;
}

void adjoint_clear(Sensitivity *w, const System *s) {
    clear(w->dM, s->masses);
    clear(w->dF, s->nv);
    clear(w->dG, s->entries);
    clear(w->dnu, s->m);
    clear(w->dgamma, s->m);
    clear(w->df, s->m);
    clear(w->denergy, 2);
    clear(w->dvdot, s->nv);
    clear(w->dlambda, s->m);
    clear(w->dB, s->rates);
    clear(w->drate, s->nq);
    clear(w->dq, s->nq);
    clear(w->dv, s->nv);
    clear(w->du, s->inputs);
    clear(w->dforce, s->nv);
    clear(w->dgiven, s->m);
    clear(w->down, s->output_count);
    clear(w->dother, s->output_count);
}

void adjoint_weigh_share(Sensitivity *w, const Mechanism *b, int e, double weight) {
    const int k = b->system->entry_row[e];
    w->dG[e] += weight * b->lambda[k];
    w->dlambda[k] += weight * b->G[e];
}

void adjoint_weigh_slip(Sensitivity *w, const Mechanism *b, int k, double weight, const double *v) {
    const System *s = b->system;
    w->dnu[k] -= weight;
    for (int e = s->row_start[k]; e < s->row_start[k + 1]; e++) w->dG[e] += weight * v[s->entry_column[e]];
    mechanism_push(b, k, weight, w->dv);
}

/* G vdot - gamma, of which the coefficients and vdot change. */
void adjoint_weigh_acceleration(Sensitivity *w, const Mechanism *b, int k, double weight) {
    const System *s = b->system;
    w->dgamma[k] -= weight;
    for (int e = s->row_start[k]; e < s->row_start[k + 1]; e++) w->dG[e] += weight * b->vdot[s->entry_column[e]];
    mechanism_push(b, k, weight, w->dvdot);
}

/* The model's own outputs, of which the values tell which of a guarded one's two expressions holds. */
static void outputs_back(Sensitivity *w, const System *s, const Adjoint *of, Instant at, Observed *o, const double *q,
                         const double *v, double *dt, double *du) {
    if (of->outputs == NULL) return;
    s->outputs(at.t, q, v, at.u, at.p, o->vdot, o->lambda, o->force, o->own, o->other);
    for (int i = 0; i < s->output_count; i++) {
        if (isfinite(o->own[i]) || !s->guarded[i]) continue;
        o->own[i] = o->other[i];
        w->dother[i] = w->down[i];
        w->down[i] = 0;
    }
    of->outputs(at.t, q, v, at.u, at.p, o->vdot, o->lambda, o->force, w->down, w->dother, dt, w->dq, w->dv, du,
                w->dvdot, w->dlambda, w->dforce);
}

/* The solve; then M, F, G, gamma in  b = dF + dG^T lambda - dM vdot ,  c = dgamma - dG vdot . */
static Status solve_back(Sensitivity *w, Mechanism *b) {
    const System *s = b->system;
    double *x = w->b, *mu = w->c;
    for (int k = 0; k < s->m; k++) w->known[k] = -w->dlambda[k];
    if (linear_nearest(&b->linear, w->dvdot, w->known, x, mu) != OK) return FAILED;
    for (int k = 0; k < s->m; k++) {
        mu[k] = -mu[k]; /* which stands on the other side there */
        w->dgiven[k] = w->dlambda[k] + mechanism_row(b, k, x);
        w->dgamma[k] += mu[k];
    }
    for (int i = 0; i < s->nv; i++) w->dF[i] += x[i];
    for (int e = 0; e < s->masses; e++) {
        const int i = s->mass_row[e], j = s->mass_column[e];
        w->dM[e] -= x[i] * b->vdot[j] + (i != j ? x[j] * b->vdot[i] : 0);
    }
    for (int e = 0; e < s->entries; e++) {
        const int k = s->entry_row[e], j = s->entry_column[e];
        w->dG[e] += x[j] * b->lambda[k] - mu[k] * b->vdot[j];
    }
    return OK;
}

/* q' = B v + b, or v. */
static void rates_back(Sensitivity *w, const Mechanism *b, const Adjoint *of, Instant at, const double *q,
                       const double *v, double *dt, double *du) {
    const System *s = b->system;
    for (int j = 0; j < s->nv && s->kinematics == NULL; j++) w->dv[j] += w->drate[j];
    for (int e = 0; e < s->rates; e++) {
        w->dB[e] += w->drate[s->rate_row[e]] * v[s->rate_column[e]];
        w->dv[s->rate_column[e]] += w->drate[s->rate_row[e]] * b->B[e];
    }
    if (s->kinematics != NULL) of->kinematics(at.t, q, at.u, at.p, w->dB, w->drate, dt, w->dq, du);
}

Status adjoint_back(Sensitivity *w, Mechanism *b, const System *s, const Adjoint *of, Instant at, Observed *o,
                    const double *q, const double *v, double *dt, double *du) {
    if (o != NULL) outputs_back(w, s, of, at, o, q, v, dt, du);
    if (b != NULL) {
        for (int e = 0; e < s->entries; e++) adjoint_weigh_share(w, b, e, w->dforce[s->entry_column[e]]);
        if (solve_back(w, b) != OK) return FAILED;
        rates_back(w, b, of, at, q, v, dt, du);
    }
    if (of->equations != NULL)
        of->equations(at.t, q, v, at.u, at.p, w->dM, w->dF, w->dG, w->dnu, w->dgamma, w->df, w->denergy, dt, w->dq,
                      w->dv, du);
    return OK;
}

void adjoint_settle(Sensitivity *w, Mechanism *b, const Adjoint *of, Instant at, const double *q, double *dt) {
    const System *s = b->system;
    for (int i = 0; i < s->unwrapped_count; i++) {
        b->angle[i] = w->dq[s->unwrapped[i]];
        w->dq[s->unwrapped[i]] = 0;
    }
    if (s->unwrapped_count > 0) of->unwrapped(at.t, q, at.u, at.p, b->angle, dt, w->dq, w->du);
    mechanism_settle_change(b, q, w->dq);
}

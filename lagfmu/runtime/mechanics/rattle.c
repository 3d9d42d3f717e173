/* rattle.c -- RATTLE (Andersen 1983; Hairer, Lubich & Wanner, Geometric Numerical Integration, 2nd
 * ed., sect. VII.1.4, eq. 1.26) for M constant, F(q, t), f(q, t) = offset (mostly 0):
 *
 *   v_h = v + h/2 M^-1 (F(q) + G(q)^T lambda) ,  q1 = q + h v_h ,  f(q1) = offset
 *   v1 = v_h + h/2 M^-1 (F(q1) + G(q1)^T mu) ,   G(q1) v1 = nu(q1)
 *
 * symmetric, symplectic, of order 2; raised to order 6 by Kahan and Li's symmetric composition of
 * nine steps gamma_r h (sect. V.3.2, eq. 3.11).  The energy error does not grow but by rounding.
 *
 * lambda: simplified Newton with the factors at q, until what is left is rounding.  Dense output:
 * the quintic Hermite polynomial of q (from q, v, a at both ends), and its derivative for v. */
#include "mechanism.h"

#include "step_size.h"

#include <string.h>

enum { STAGES = 9, RATTLE_ITERATIONS = 100 };
static const double gamma_r[STAGES] = {
    0.39216144400731413928,  0.33259913678935943860, -0.70624617255763935981,
    0.082213596293550800231, 0.79854399093482996340, 0.082213596293550800231,
    -0.70624617255763935981, 0.33259913678935943860, 0.39216144400731413928};
static const double SMALL = 1e-9; /* what rounding may leave of a constraint, in its terms */

/* b->f <- offset - f(q) on the rows that act; `largest` of it in units of b->lambda. */
static Status distance(Mechanism *b, Instant at, const int *active, const double *offset,
                       const double *q, double *largest) {
    *largest = 0;
    if (mechanism_residual(b, at, q, b->f) != OK) return FAILED;
    for (int k = 0; k < b->system->m; k++) {
        if (!active[k]) continue;
        b->f[k] = (offset == NULL ? 0 : offset[k]) - b->f[k];
        double ratio = fabs(b->f[k]) / b->lambda[k];
        if (!(ratio <= *largest)) *largest = ratio;
    }
    return OK;
}

/* q1 <- q1 + M^-1 G^T mu so that f(q1) = offset, with M and G as they were factored; the same is
 * added to `step` = q1 - q.  b->lambda: sizes of the constraints' terms. */
static Status onto_constraints(Mechanism *b, Instant at, const int *active, const double *offset,
                               double *q1, double *step) {
    double before = HUGE_VAL;
    for (int k = 0; k < b->system->m; k++)
        b->lambda[k] = mechanism_row_size(b, k, q1) + mechanism_row_size(b, k, step) + DBL_MIN;
    for (int count = 0; count < RATTLE_ITERATIONS; count++) {
        double largest;
        if (distance(b, at, active, offset, q1, &largest) != OK) return FAILED;
        if (largest == 0 || (largest > before / 2 && largest < SMALL)) return OK;
        if (!(largest < before)) break;
        if (linear_nearest(&b->linear, NULL, b->f, b->dq, NULL) != OK) return FAILED;
        for (int j = 0; j < b->system->nv; j++) {
            q1[j] += b->dq[j];
            step[j] += b->dq[j];
        }
        before = largest;
    }
    return fail(b->why, "the constraints cannot be met: reduce solver.step");
}

/* M, F, G at (q, v), and their factors. */
static Status evaluate_forces(Mechanism *b, Instant at, const int *active, const double *q,
                              const double *v) {
    if (mechanism_evaluate(b, at, q, v) != OK) return FAILED;
    return linear_factor(&b->linear, b->M, b->G, active);
}

/* One step of order 2 from `at`; b stands evaluated and factored at (q, v), before and after. */
static Status basic_step(Mechanism *b, Instant *at, double t_new, double h, const int *active,
                         const double *offset, double *q, double *v, double *step) {
    const int n = b->system->nv, m = b->system->m;
    at->t = t_new;
    /* predicted with the acceleration at q, which meets the constraints but for h^3 */
    if (linear_solve(&b->linear, b->F, b->gamma, b->vdot, NULL) != OK) return FAILED;
    for (int j = 0; j < n; j++) {
        step[j] = h * (v[j] + 0.5 * h * b->vdot[j]);
        q[j] += step[j];
    }
    if (onto_constraints(b, *at, active, offset, q, step) != OK) return FAILED;
    for (int j = 0; j < n; j++) v[j] = step[j] / h;
    if (evaluate_forces(b, *at, active, q, v) != OK) return FAILED;
    for (int j = 0; j < n; j++) b->trial[j] = 0.5 * h * b->F[j];
    for (int k = 0; k < m; k++) b->f[k] = active[k] ? b->nu[k] - mechanism_row(b, k, v) : 0;
    if (linear_solve(&b->linear, b->trial, b->f, b->dq, NULL) != OK) return FAILED;
    for (int j = 0; j < n; j++) v[j] += b->dq[j];
    return OK;
}

static Status composed_step(Mechanism *b, Instant at, double t_new, double h, const int *active,
                            const double *offset, double *y, double *step) {
    const int n = b->system->nv;
    const double t = at.t;
    double part = 0;
    if (evaluate_forces(b, at, active, y, y + n) != OK) return FAILED;
    for (int r = 0; r < STAGES; r++) {
        part += gamma_r[r];
        double next = r == STAGES - 1 ? t_new : t + part * h;
        if (basic_step(b, &at, next, gamma_r[r] * h, active, offset, y, y + n, step) != OK)
            return FAILED;
    }
    return OK;
}

static Status rattle_step(Integrator *i, const Ode *ode, const Control *control, double t_bound) {
    const Acting *of = ode->mechanism;
    Mechanism *b = of->b;
    const int ny = i->ny;
    const Fixed fixed = step_size_fixed(i->t, t_bound, control->fixed_step);
    double *y = i->scratch, *step = y + ny;
    if (!(fabs(fixed.h) > 0))
        return refused_step(b->why, i->t, "no step leads to the bound", 0);
    memcpy(y, i->y, (size_t)ny * sizeof *y);
    const Instant start = {i->t, of->u, of->p};
    if (composed_step(b, start, fixed.t_new, fixed.h, of->active, of->offset, y, step) != OK)
        return refused_step(b->why, i->t, "a stage of rattle fails", 1);
    if (!step_size_finite(ny, y))
        return refused_step(b->why, i->t, "the state is not finite", 0);
    memcpy(i->y_old, i->y, (size_t)ny * sizeof *y);
    memcpy(i->y, y, (size_t)ny * sizeof *y);
    i->t_old = i->t;
    i->t = fixed.t_new;
    i->h_next = fixed.h;
    i->fixed_left = fixed.left;
    i->fresh = 1;
    return OK;
}

/* q = q0 + s h v0 + s^2 (C0 + s (C1 + s (C2 + s C3))), the quintic through q, v, a at both ends. */
static Status rattle_prepare(Integrator *i, const Ode *ode) {
    const int n = i->ny / 2;
    const double h = i->t - i->t_old;
    const double *q0 = i->y_old, *v0 = q0 + n, *q1 = i->y, *v1 = q1 + n;
    double *C0 = i->dense, *C1 = C0 + n, *C2 = C1 + n, *C3 = C2 + n;
    if (ode->rate(ode->context, i->t_old, i->y_old, i->f_old) != OK) return FAILED;
    if (step_size_rate(i, ode) != OK) return FAILED;
    for (int j = 0; j < n; j++) {
        double a0 = 0.5 * h * h * i->f_old[n + j], a1 = 0.5 * h * h * i->f[n + j];
        double dq = q1[j] - q0[j] - h * v0[j] - a0, dv = h * (v1[j] - v0[j]) - 2 * a0;
        double da = a1 - a0;
        C0[j] = a0;
        C1[j] = 10 * dq - 4 * dv + da;
        C2[j] = -15 * dq + 7 * dv - 2 * da;
        C3[j] = 6 * dq - 3 * dv + da;
    }
    return OK;
}

static void rattle_dense(const Integrator *i, double t, double *y) {
    const int n = i->ny / 2;
    const double h = i->t - i->t_old, s = (t - i->t_old) / h;
    const double *q0 = i->y_old, *v0 = q0 + n;
    const double *C0 = i->dense, *C1 = C0 + n, *C2 = C1 + n, *C3 = C2 + n;
    for (int j = 0; j < n; j++) {
        y[j] = q0[j] + s * (h * v0[j] + s * (C0[j] + s * (C1[j] + s * (C2[j] + s * C3[j]))));
        double rise = 2 * C0[j] + s * (3 * C1[j] + s * (4 * C2[j] + s * 5 * C3[j]));
        y[n + j] = v0[j] + s * rise / h;
    }
}

SHARED_VALUE const Method rattle = {
    .name = "rattle",
    .dense_arrays = 2,
    .scratch_arrays = 2, /* y, q1 - q */
    .fixed = 1,
    .fewest_steps = 8,
    .of_mechanism = 1,
    .step = rattle_step,
    .prepare_dense = rattle_prepare,
    .dense = rattle_dense,
};

/* rk4.c -- the classical Runge-Kutta method of order 4 (Hairer, Norsett & Wanner I, Table II.1.2)
 * at a fixed step that divides the way to t_bound evenly, h = H / ceil(H / fixed_step): a constant
 * cost a step, for real time.
 *
 *   y1 = y + h/6 (k1 + 2 k2 + 2 k3 + k4)
 *
 * Error estimate: the difference to the method of order 3 that has f(t + h, y1) instead of k4.
 * Dense output: cubic Hermite interpolation. */
#include "restrict.h"
#include "step_size.h"

enum { ERROR, DIFFERENCE, SLOPE, ROWS_KEPT }; /* rows of i->dense: h/6 (k4 - f1), y1 - y0, h f1 */

/* k2, k3, k4, f1, y1 one after the other in k. */
static Status rk4_stages(const Integrator *i, const Ode *ode, double h, double t_new,
                         double *RESTRICT k) {
    const int n = i->ny;
    const double t = i->t;
    const double *RESTRICT y = i->y, *RESTRICT k1 = i->f;
    double *k2 = k, *k3 = k2 + n, *k4 = k3 + n, *f1 = k4 + n, *y1 = f1 + n;
    for (int j = 0; j < n; j++) y1[j] = y[j] + 0.5 * h * k1[j];
    if (ode->rate(ode->context, t + 0.5 * h, y1, k2) != OK) return FAILED;
    for (int j = 0; j < n; j++) y1[j] = y[j] + 0.5 * h * k2[j];
    if (ode->rate(ode->context, t + 0.5 * h, y1, k3) != OK) return FAILED;
    for (int j = 0; j < n; j++) y1[j] = y[j] + h * k3[j];
    if (ode->rate(ode->context, t_new, y1, k4) != OK) return FAILED;
    for (int j = 0; j < n; j++) y1[j] = y[j] + h / 6 * (k1[j] + 2 * (k2[j] + k3[j]) + k4[j]);
    return ode->rate(ode->context, t_new, y1, f1);
}

static Status rk4_step(Integrator *i, const Ode *ode, const Control *control, double t_bound) {
    const int n = i->ny;
    const Fixed step = step_size_fixed(i->t, t_bound, control->fixed_step);
    const double h = step.h;
    double *k4 = i->scratch + 2 * n, *f1 = k4 + n, *y1 = f1 + n;
    if (!(fabs(h) > 0)) return refused_step(ode->why, i->t, "no step leads to the bound", 0);
    if (step_size_rate(i, ode) != OK) return FAILED;
    if (rk4_stages(i, ode, h, step.t_new, i->scratch) != OK)
        return refused_step(ode->why, i->t, "a stage cannot be evaluated", 1);
    if (!step_size_finite(2 * n, f1))
        return refused_step(ode->why, i->t, "the state is not finite", 0);
    for (int j = 0; j < n; j++) {
        i->dense[ERROR * n + j] = h / 6 * (k4[j] - f1[j]);
        i->dense[DIFFERENCE * n + j] = y1[j] - i->y[j];
        i->dense[SLOPE * n + j] = h * f1[j];
        i->y_old[j] = i->y[j];
        i->f_old[j] = i->f[j];
        i->y[j] = y1[j];
        i->f[j] = f1[j];
    }
    i->t_old = i->t;
    i->t = step.t_new;
    i->fixed_left = step.left;
    i->h_next = h;
    return OK;
}

static double rk4_error(const Integrator *i, int component) {
    return i->dense[ERROR * i->ny + component];
}

static void rk4_dense(const Integrator *i, double t, double *y) {
    const int n = i->ny;
    const double h = i->t - i->t_old, s = (t - i->t_old) / h, z = 1 - s;
    for (int j = 0; j < n; j++) {
        double change = i->dense[DIFFERENCE * n + j], slope = i->dense[SLOPE * n + j];
        double bend = z * (h * i->f_old[j] - change) - s * (slope - change);
        y[j] = i->y_old[j] + s * (change + z * bend);
    }
}

SHARED_VALUE const Method rk4 = {
    .name = "rk4",
    .dense_arrays = ROWS_KEPT,
    .scratch_arrays = 5, /* k2, k3, k4, f1, y1 */
    .fixed = 1,
    .fewest_steps = 100,
    .step = rk4_step,
    .dense = rk4_dense,
    .error = rk4_error,
};

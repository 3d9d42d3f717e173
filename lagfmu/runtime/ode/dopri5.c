/* dopri5.c -- Dormand and Prince's explicit Runge-Kutta pair 5(4) in 7 stages, the last of which is
 * the first of the next step, with dense output of order 4 (Hairer, Norsett & Wanner I, 2nd ed.,
 * Table II.5.2 and eq. II.6.10, in Hairer's nested form).
 *
 *   k_r = f(t + c_r h, y + h sum_s a_rs k_s) ,   y1 = y + h sum_s b_s k_s ,
 *   err = h |sum_s e_s k_s| */
#include "step_size.h"

static const double
    c2 = 1.0 / 5, c3 = 3.0 / 10, c4 = 4.0 / 5, c5 = 8.0 / 9,
    a21 = 1.0 / 5,
    a31 = 3.0 / 40, a32 = 9.0 / 40,
    a41 = 44.0 / 45, a42 = -56.0 / 15, a43 = 32.0 / 9,
    a51 = 19372.0 / 6561, a52 = -25360.0 / 2187, a53 = 64448.0 / 6561, a54 = -212.0 / 729,
    a61 = 9017.0 / 3168, a62 = -355.0 / 33, a63 = 46732.0 / 5247, a64 = 49.0 / 176,
    a65 = -5103.0 / 18656,
    b1 = 35.0 / 384, b3 = 500.0 / 1113, b4 = 125.0 / 192, b5 = -2187.0 / 6784, b6 = 11.0 / 84,
    e1 = 71.0 / 57600, e3 = -71.0 / 16695, e4 = 71.0 / 1920, e5 = -17253.0 / 339200,
    e6 = 22.0 / 525, e7 = -1.0 / 40,
    d1 = -12715105075.0 / 11282082432, d3 = 87487479700.0 / 32700410799,
    d4 = -10690763975.0 / 1880347072, d5 = 701980252875.0 / 199316789632,
    d6 = -1453857185.0 / 822651844, d7 = 69997945.0 / 29380423;

static const double SAFETY = 0.9, LEAST_FACTOR = 0.2, LARGEST_FACTOR = 10, RETREAT = 0.1;

enum { KEPT = 4 }; /* stages 3 to 6; then the four coefficients of the dense output */

/* k_2 to k_7, one after the other in k, and y1. */
static Status stages(const Integrator *i, const Ode *ode, double h, double t_new,
                     double *restrict k, double *restrict y1) {
    const int n = i->ny;
    const double t = i->t;
    const double *restrict y = i->y, *restrict k1 = i->f;
    double *k2 = k, *k3 = k2 + n, *k4 = k3 + n, *k5 = k4 + n, *k6 = k5 + n, *k7 = k6 + n;
    for (int j = 0; j < n; j++) y1[j] = y[j] + h * (a21 * k1[j]);
    if (ode->rate(ode->context, t + c2 * h, y1, k2) != OK) return FAILED;
    for (int j = 0; j < n; j++) y1[j] = y[j] + h * (a31 * k1[j] + a32 * k2[j]);
    if (ode->rate(ode->context, t + c3 * h, y1, k3) != OK) return FAILED;
    for (int j = 0; j < n; j++) y1[j] = y[j] + h * (a41 * k1[j] + a42 * k2[j] + a43 * k3[j]);
    if (ode->rate(ode->context, t + c4 * h, y1, k4) != OK) return FAILED;
    for (int j = 0; j < n; j++)
        y1[j] = y[j] + h * (a51 * k1[j] + a52 * k2[j] + a53 * k3[j] + a54 * k4[j]);
    if (ode->rate(ode->context, t + c5 * h, y1, k5) != OK) return FAILED;
    for (int j = 0; j < n; j++)
        y1[j] = y[j] + h * (a61 * k1[j] + a62 * k2[j] + a63 * k3[j] + a64 * k4[j] + a65 * k5[j]);
    if (ode->rate(ode->context, t_new, y1, k6) != OK) return FAILED;
    for (int j = 0; j < n; j++)
        y1[j] = y[j] + h * (b1 * k1[j] + b3 * k3[j] + b4 * k4[j] + b5 * k5[j] + b6 * k6[j]);
    return ode->rate(ode->context, t_new, y1, k7);
}

/* The error in units of the tolerance; not a number if y1 is not finite. */
static double error_norm(const Integrator *i, const Control *control, double h, const double *k,
                         const double *restrict y1) {
    const int n = i->ny;
    const double tolerance = step_size_tolerance(control);
    const double *restrict y = i->y, *restrict scale = control->scale, *restrict k1 = i->f;
    const double *k3 = k + n, *k4 = k3 + n, *k5 = k4 + n, *k6 = k5 + n, *k7 = k6 + n;
    double square = 0;
    for (int j = 0; j < n; j++) {
        double error = e1 * k1[j] + e3 * k3[j] + e4 * k4[j] + e5 * k5[j] + e6 * k6[j] + e7 * k7[j];
        double ratio = h * error / step_size_weight(tolerance, y[j], y1[j], scale[j]);
        square += ratio * ratio + 0 * y1[j];
    }
    return sqrt(square / n);
}

/* h_new / h = 0.9 err^(-3/16), within limits (eq. II.4.13, with 3/16 for 1/5: square roots are
 * exact to the bit on every platform). */
static double step_factor(double error) {
    if (!isfinite(error)) return RETREAT;
    double eighth = sqrt(sqrt(sqrt(error))), root = eighth * sqrt(eighth);
    if (root * LARGEST_FACTOR < SAFETY) return LARGEST_FACTOR;
    return SAFETY < LEAST_FACTOR * root ? LEAST_FACTOR : SAFETY / root;
}

static Status dopri5_step(Integrator *i, const Ode *ode, const Control *control, double t_bound) {
    const int n = i->ny;
    double *y1 = i->scratch, *k = y1 + n, *k3 = k + n, *k7 = k + 5 * n;
    Trial trial;
    Status status = trial_begin(&trial, i, ode, control, t_bound, 4);
    while (status == OK) {
        double error = HUGE_VAL;
        if (stages(i, ode, trial.h, trial.t_new, k, y1) == OK)
            error = error_norm(i, control, trial.h, k, y1);
        else
            trial.unevaluated = 1;
        double factor = step_factor(error);
        if (error <= 1) {
            trial_accept(&trial, i, y1, factor);
            for (int j = 0; j < KEPT * n; j++) i->dense[j] = k3[j];
            for (int j = 0; j < n; j++) i->f[j] = k7[j];
            i->fresh = 0;
            return OK;
        }
        status = trial_reject(&trial, i, ode, factor);
    }
    return FAILED;
}

/* Replaces k_3 to k_6 in i->dense by the polynomial's coefficients r_1 to r_4, but r_2 by
 * h k_1 = r_1 + r_2 (why: dop853.c). */
static Status dopri5_prepare(Integrator *i, const Ode *ode) {
    const int n = i->ny;
    const double h = i->t - i->t_old;
    const double *k1 = i->f_old, *k7 = i->f;
    double *k3 = i->dense, *k4 = k3 + n, *k5 = k4 + n, *k6 = k5 + n;
    (void)ode;
    for (int j = 0; j < n; j++) {
        double r1 = i->y[j] - i->y_old[j], r2 = h * k1[j], r3 = r1 - h * k7[j] - (r2 - r1);
        double r4 = h * (d1 * k1[j] + d3 * k3[j] + d4 * k4[j] + d5 * k5[j] + d6 * k6[j] +
                         d7 * k7[j]);
        k3[j] = r1;
        k4[j] = r2;
        k5[j] = r3;
        k6[j] = r4;
    }
    return OK;
}

static void dopri5_dense(const Integrator *i, double t, double *y) {
    const int n = i->ny;
    const double s = (t - i->t_old) / (i->t - i->t_old), z = 1 - s;
    const double *r1 = i->dense, *r2 = r1 + n, *r3 = r2 + n, *r4 = r3 + n;
    for (int j = 0; j < n; j++)
        y[j] = i->y_old[j] + s * (z * r2[j] + s * (r1[j] + z * (r3[j] + z * r4[j])));
}

static int dopri5_doubles(int ny) {
    return 7 * ny; /* y1, k_2 to k_7 */
}

static int dopri5_ints(int ny) {
    (void)ny;
    return 0;
}

const Method dopri5 = {
    .name = "dopri5",
    .dense_arrays = KEPT,
    .scratch_doubles = dopri5_doubles,
    .scratch_ints = dopri5_ints,
    .step = dopri5_step,
    .prepare_dense = dopri5_prepare,
    .dense = dopri5_dense,
};

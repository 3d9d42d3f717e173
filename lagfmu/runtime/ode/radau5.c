/* radau5.c -- the Radau IIA method of order 5 in 3 stages (Hairer & Wanner II, 2nd ed., sect.
 * IV.8): collocation at c1, c2, 1, stiffly accurate, for stiff scenes.
 *
 *   Z = h (A x I) F(t + c h, y + Z) ,  y1 = y + z_3 ,  A^-1 = T L T^-1 ,  L = [g  .  .]
 *                                                                         [.  a -b]
 *                                                                         [.  b  a]
 * With W = T^-1 Z simplified Newton (eq. IV.8.4) is one real and one complex system a time,
 *
 *   (g/h - J) dw_1 = r_1 ,   ((a + i b)/h - J) (dw_2 + i dw_3) = r_2 + i r_3 ,
 *   r = T^-1 F - (L/h) W
 *
 * Error: err = (g/h - J)^-1 (f(t, y) - p'(0)/h), p the collocation polynomial (eqs. IV.8.19,
 * IV.8.20), an estimate of order 3: err < 0.1 tol^(2/3) keeps that of the method near tol (Hairer's
 * radau5). Step sizes: Gustafsson's predictive controller (eq. IV.8.25).  Dense output: p, of order
 * 3. J is evaluated at each step, so that nothing but the last polynomial is remembered.
 *
 * Blocks behind the state (columns of derivatives, S' = J S + ...) are solved for with the state's factors in the
 * state's iterations, which do not look at them: an iterate of S is the derivative of that of y. */
#include "lu.h"
#include "step_size.h"

#define SQRT6 2.4494897427831780982 /* literals, so that the tables below are constants */

static const double node1 = (4 - SQRT6) / 10, node2 = (4 + SQRT6) / 10;
static const double g = 3.6378342527444957322, a = 2.6810828736277521339,
                    b = 3.0504301992474105694;
static const double T[3][3] = {
    {0.091232394870892942791, -0.14125529502095420843, -0.030029194105147424492},
    {0.24171793270710701896, 0.20412935229379993200, 0.38294211275726193774},
    {0.96604818261509293619, 1, 0}};
static const double T_INVERSE[3][3] = {
    {4.3255798900631553510, 0.33919925181580986954, 0.54177053993587487119},
    {-4.1787185915519047273, -0.32768282076106238708, 0.47662355450055045196},
    {-0.50287263494578687595, 2.5719269498556054292, -0.59603920482822492497}};
/* p(s) = P_1 s + P_2 s^2 + P_3 s^3 from z_i = p(c_i) */
static const double P[3][3] = {
    {(13 + 7 * SQRT6) / 3, (13 - 7 * SQRT6) / 3, 1.0 / 3},
    {-(23 + 22 * SQRT6) / 3, -(23 - 22 * SQRT6) / 3, -8.0 / 3},
    {(10 + 15 * SQRT6) / 3, (10 - 15 * SQRT6) / 3, 10.0 / 3}};

static const double RADAU_SAFETY = 0.9, RADAU_LEAST_FACTOR = 1.0 / 5, RADAU_LARGEST_FACTOR = 8;
static const double LEAST_ERROR = 1e-2; /* that the predictive controller remembers */
enum {
    NEWTON_ITERATIONS = 7 /* of Newton's method, at most */
};

/* Where things lie in the scratch. */
typedef struct {
    double *J, *real, *re, *im;    /* (n * n) of the state; the LU factors */
    double *z, *w, *r;             /* (3 ny) */
    double *y, *weight, *error, *defect; /* (ny) */
    int *pivots, *pivots_complex;
} Work;

static Work work_of(const Integrator *i) {
    const int n = i->ny, square = i->watched * i->watched;
    Work x;
    x.J = i->scratch;
    x.real = x.J + square;
    x.re = x.real + square;
    x.im = x.re + square;
    x.z = x.im + square;
    x.w = x.z + 3 * n;
    x.r = x.w + 3 * n;
    x.y = x.r + 3 * n;
    x.weight = x.y + n;
    x.error = x.weight + n;
    x.defect = x.error + n;
    x.pivots = i->pivots;
    x.pivots_complex = i->pivots + i->watched;
    return x;
}

/* out = (m x I) in, for three blocks of n; they may be the same */
static void combine(int n, const double m[3][3], const double *in, double *out) {
    for (int j = 0; j < n; j++) {
        const double x1 = in[j], x2 = in[n + j], x3 = in[2 * n + j];
        for (int k = 0; k < 3; k++) out[k * n + j] = m[k][0] * x1 + m[k][1] * x2 + m[k][2] * x3;
    }
}

/* The polynomial whose coefficients are in i->dense, less its value at s0. */
static double polynomial(const Integrator *i, int j, double s, double s0) {
    const double *p = i->dense + j;
    const int n = i->ny;
    return (s - s0) * (p[0] + (s + s0) * p[n] + (s * s + s * s0 + s0 * s0) * p[2 * n]);
}

/* Z to start from: the polynomial of the step before, extended, or zero. */
static void predict(const Integrator *i, Work x, double h) {
    const int n = i->ny;
    const double ratio = i->error_old > 0 ? h / (i->t - i->t_old) : 0;
    const double c[3] = {node1, node2, 1};
    for (int k = 0; k < 3; k++)
        for (int j = 0; j < n; j++)
            x.z[k * n + j] = ratio > 0 ? polynomial(i, j, 1 + c[k] * ratio, 1) : 0;
    combine(n, T_INVERSE, x.z, x.w);
}

/* 0 if a matrix is singular. */
static int factor_matrices(int n, Work x, double h) {
    for (int j = 0; j < n * n; j++) {
        x.real[j] = x.re[j] = -x.J[j];
        x.im[j] = 0;
    }
    for (int j = 0; j < n; j++) {
        x.real[j * n + j] += g / h;
        x.re[j * n + j] += a / h;
        x.im[j * n + j] = b / h;
    }
    return lu_factor(n, x.real, x.pivots) == 0 &&
           lu_factor_complex(n, x.re, x.im, x.pivots_complex) == 0;
}

/* r = T^-1 F(t + c h, y + Z) - (L/h) W; FAILED if a stage cannot be evaluated. */
static Status stage_residual(const Integrator *i, const Ode *ode, Work x, const Trial *trial) {
    const int n = i->ny;
    const double h = trial->h, c[3] = {node1, node2, 1};
    for (int k = 0; k < 3; k++) {
        for (int j = 0; j < n; j++) x.y[j] = i->y[j] + x.z[k * n + j];
        const double t = k == 2 ? trial->t_new : i->t + c[k] * h;
        if (ode->rate(ode->context, t, x.y, x.r + k * n) != OK) return FAILED;
    }
    combine(n, T_INVERSE, x.r, x.r);
    const double *w1 = x.w, *w2 = w1 + n, *w3 = w2 + n;
    for (int j = 0; j < n; j++) {
        x.r[j] -= g / h * w1[j];
        x.r[n + j] -= (a * w2[j] - b * w3[j]) / h;
        x.r[2 * n + j] -= (b * w2[j] + a * w3[j]) / h;
    }
    return OK;
}

/* Of n numbers in each of `stages` that are `apart`. */
static double weighted_mean(int n, int stages, int apart, const double *x, const double *weight) {
    double sum = 0;
    for (int k = 0; k < stages; k++)
        for (int j = 0; j < n; j++) {
            double ratio = x[k * apart + j] / weight[j];
            sum += ratio * ratio;
        }
    return sqrt(sum / (stages * n));
}

/* Newton's correction of the state and the blocks behind it, in x.r. */
static void correct_blocks(const Integrator *i, Work x) {
    const int n = i->watched, all = i->ny;
    for (int from = 0; from < all; from += n) {
        lu_solve(n, x.real, x.pivots, x.r + from);
        lu_solve_complex(n, x.re, x.im, x.pivots_complex, x.r + all + from, x.r + 2 * all + from);
    }
}

/* Solves for Z to a part `enough` of the tolerance.  The iterations that it took; 0: it diverges,
 * is too slow, or a stage cannot be evaluated. */
static int newton_on_stages(const Integrator *i, const Ode *ode, Work x, Trial *trial, double enough) {
    const int n = i->watched, all = i->ny;
    double before = 0, theta = 0, eta = 1;
    for (int count = 1; count <= NEWTON_ITERATIONS; count++) {
        if (stage_residual(i, ode, x, trial) != OK) {
            trial->unevaluated = 1;
            return 0;
        }
        correct_blocks(i, x);
        double size = weighted_mean(n, 3, all, x.r, x.weight);
        if (!isfinite(size)) return 0;
        if (count > 1) {
            double ratio = size / before;
            theta = count == 2 ? ratio : sqrt(ratio * theta); /* smoothed */
            if (!(theta < 0.99)) return 0;
            eta = theta / (1 - theta);
            double last = eta * size;
            for (int k = count; k < NEWTON_ITERATIONS; k++) last *= theta;
            if (last > enough) return 0;
        }
        for (int j = 0; j < 3 * all; j++) x.w[j] += x.r[j];
        combine(all, T, x.w, x.z);
        if (eta * size <= enough) return count;
        before = size;
    }
    return 0;
}

/* err in units of the tolerance; evaluated anew at y + err where a first estimate is too large:
 * that damps what is infinitely stiff (eq. IV.8.20). */
static double implicit_error_norm(const Integrator *i, const Ode *ode, Work x, double h, double tolerance,
                                  const double *scale, int twice) {
    const int n = i->watched, all = i->ny;
    for (int j = 0; j < n; j++) {
        double end = i->y[j] + x.z[2 * all + j];
        x.weight[j] = step_size_weight(tolerance, i->y[j], end, scale[j]) + 0 * end;
        x.defect[j] =
            -(P[0][0] * x.z[j] + P[0][1] * x.z[all + j] + P[0][2] * x.z[2 * all + j]) / h;
        x.error[j] = i->f[j] + x.defect[j];
    }
    lu_solve(n, x.real, x.pivots, x.error);
    double size = weighted_mean(n, 1, all, x.error, x.weight);
    if (!twice || !(size >= 1)) return size;
    for (int j = 0; j < all; j++) x.y[j] = j < n ? i->y[j] + x.error[j] : i->y[j];
    if (ode->rate(ode->context, i->t, x.y, x.error) != OK) return size;
    for (int j = 0; j < n; j++) x.error[j] += x.defect[j];
    lu_solve(n, x.real, x.pivots, x.error);
    return weighted_mean(n, 1, all, x.error, x.weight);
}

static double limit(double factor) {
    return fmax(RADAU_LEAST_FACTOR, fmin(RADAU_LARGEST_FACTOR, factor));
}

static double fourth_root(double x) {
    return sqrt(sqrt(x));
}

/* h_new / h from the error alone, a little less after many iterations. */
static double implicit_step_factor(double error, int count) {
    double safety = RADAU_SAFETY * (1 + 2 * NEWTON_ITERATIONS) / (count + 2 * NEWTON_ITERATIONS);
    return limit(safety / fourth_root(fmax(error, 1e-10)));
}

/* ... and from the trend of the last two errors, if that asks for less. */
static double predictive_factor(const Integrator *i, double h, double error, double factor) {
    if (!(i->error_old > 0)) return factor;
    double now = fmax(error, 1e-10);
    double trend = h / (i->t - i->t_old) * fourth_root(i->error_old / (now * now)) * RADAU_SAFETY;
    return fmin(factor, limit(trend));
}

static void accept_trial(Integrator *i, const Trial *trial, Work x, double error, double factor) {
    const int n = i->ny;
    factor = predictive_factor(i, trial->h, error, factor);
    for (int j = 0; j < n; j++) x.y[j] = i->y[j] + x.z[2 * n + j];
    trial_accept(trial, i, x.y, factor);
    combine(n, P, x.z, i->dense);
    i->error_old = fmax(LEAST_ERROR, error);
    i->error = error;
}

static Status radau5_step(Integrator *i, const Ode *ode, const Control *control, double t_bound) {
    const int n = i->watched;
    if (n > RADAU5_MOST_STATES)
        return fail(ode->why,
                    "radau5 keeps dense matrices, of %d states at most; this model has %d: choose "
                    "solver.method = dop853",
                    RADAU5_MOST_STATES, n);
    const double whole = step_size_tolerance(control);
    const double tolerance = 0.1 * step_size_root(whole * whole, 3);
    const double enough = fmax(10 * DBL_EPSILON / tolerance, fmin(0.03, sqrt(tolerance)));
    const Work x = work_of(i);
    Trial trial;
    Status status = trial_begin(&trial, i, ode, control, t_bound, 3);
    if (status == OK) status = ode->jacobian(ode->context, i->t, i->y, x.J, x.defect);
    while (status == OK) {
        int count = 0;
        double factor = 0.5;
        predict(i, x, trial.h);
        for (int j = 0; j < n; j++)
            x.weight[j] = step_size_weight(tolerance, i->y[j], i->y[j], control->scale[j]);
        if (factor_matrices(n, x, trial.h)) count = newton_on_stages(i, ode, x, &trial, enough);
        if (count > 0) {
            int first = trial.rejected > 0 || !(i->error_old > 0);
            double error =
                implicit_error_norm(i, ode, x, trial.h, tolerance, control->scale, first);
            factor = isfinite(error) ? implicit_step_factor(error, count) : RADAU_LEAST_FACTOR;
            if (error < 1) {
                accept_trial(i, &trial, x, error, factor);
                return OK;
            }
            if (first && trial.rejected == 0) factor = 0.1;
        }
        status = trial_reject(&trial, i, ode, factor);
    }
    return FAILED;
}

static void radau5_dense(const Integrator *i, double t, double *y) {
    const double s = (t - i->t_old) / (i->t - i->t_old);
    for (int j = 0; j < i->ny; j++) y[j] = i->y_old[j] + polynomial(i, j, s, 0);
}

SHARED_VALUE const Method radau5 = {
    .name = "radau5",
    .dense_arrays = 3,
    .scratch_arrays = 13,
    .scratch_matrices = 4,
    .coarse = 1,
    .step = radau5_step,
    .dense = radau5_dense,
};
